// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/world/region_store.h"

#include "runtime/base/hash.h"
#include "runtime/base/safetensors.h"

#include <cstring>

namespace semrover {

namespace {

Path region_path(const RunFolder& run, uint32_t region)
{
    return run.path() / "regions" / fmt::format("{:06}.safetensors", region);
}

template <typename T>
Result<std::vector<T>> read_array(const Safetensors& file, const char* name, DType dtype)
{
    SR_TRY(const TensorInfo* info, file.get(name));
    if (info->dtype != dtype)
        return fail(ErrorCode::bad_input, "'{}' has another type", name);
    const auto bytes = file.bytes(*info);
    std::vector<T> values(bytes.size() / sizeof(T));
    if (!values.empty())
        std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
    return values;
}

Result<RegionResult> read_region(const Path& path, uint32_t region)
{
    SR_TRY(const Safetensors file, Safetensors::open(path));
    RegionResult r;
    r.region = region;
    SR_TRY(r.targets, read_array<uint32_t>(file, "targets", DType::u32));
    SR_TRY(r.points, read_array<uint16_t>(file, "points", DType::f16));
    SR_TRY(r.colors, read_array<uint8_t>(file, "colors", DType::u8));
    return r;
}

} // namespace

Status save_region(RunFolder& run, const RegionResult& r)
{
    const Path path = region_path(run, r.region);
    SR_CHECK(make_folder(path.parent_path()));
    const TensorData tensors[] = {
        {"targets", DType::u32, {r.targets.size()}, std::as_bytes(std::span(r.targets))},
        {"points", DType::f16, {r.points.size()}, std::as_bytes(std::span(r.points))},
        {"colors", DType::u8, {r.colors.size()}, std::as_bytes(std::span(r.colors))},
    };
    SR_CHECK(write_safetensors(path, tensors));
    SR_TRY(const uint64_t hash, hash_file(path));
    return run.append({{"region", r.region}, {"cells", r.targets.size()}, {"xxh64", hash_text(hash)}});
}

std::vector<RegionResult> load_regions(const RunFolder& run)
{
    std::vector<RegionResult> regions;
    for (const Json& entry : run.entries()) {
        if (!entry.is_object() || !entry.value("region", Json()).is_number_unsigned())
            continue;
        const uint32_t region = entry["region"];
        const auto hash = hash_file(region_path(run, region));
        if (!hash || entry.value("xxh64", Json()) != hash_text(*hash))
            continue;
        if (auto r = read_region(region_path(run, region), region))
            regions.push_back(std::move(*r));
    }
    return regions;
}

} // namespace semrover
