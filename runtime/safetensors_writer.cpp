// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/json.h"
#include "runtime/safetensors.h"

#include <algorithm>
#include <set>

namespace semrover {

namespace {

std::string json_text(std::string_view text)
{
    return Json(text).dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string header_text(std::span<const TensorData* const> tensors, const std::map<std::string, std::string>& metadata)
{
    std::string text = "{";
    if (!metadata.empty()) {
        text += "\"__metadata__\":{";
        for (const auto& [key, value] : metadata)
            text += json_text(key) + ":" + json_text(value) + ",";
        text.back() = '}';
        text += ',';
    }
    uint64_t offset = 0;
    for (const TensorData* t : tensors) {
        text += fmt::format("{}:{{\"dtype\":\"{}\",\"shape\":[{}],\"data_offsets\":[{},{}]}},", json_text(t->name),
                            dtype_name(t->dtype), fmt::join(t->shape, ","), offset, offset + t->bytes.size());
        offset += t->bytes.size();
    }
    if (text.back() == ',')
        text.pop_back();
    text += '}';
    text.resize((text.size() + 7) / 8 * 8, ' ');
    return text;
}

void check_tensor(const TensorData& t)
{
    const Result<uint64_t> bytes = checked_bytes(t.shape, t.dtype);
    SR_ASSERT(bytes && *bytes == t.bytes.size(), "tensor {}: {} {} given with {} bytes", t.name, dtype_name(t.dtype),
              shape_text(t.shape), t.bytes.size());
    SR_ASSERT(t.name.size() <= kMaxTensorName && t.name != "__metadata__", "tensor name {}", t.name);
}

} // namespace

Status write_safetensors(const Path& path, std::span<const TensorData> tensors,
                         const std::map<std::string, std::string>& metadata)
{
    std::vector<const TensorData*> order;
    std::set<std::string_view> names;
    for (const TensorData& t : tensors) {
        check_tensor(t);
        SR_ASSERT(names.insert(t.name).second, "tensor {} given twice", t.name);
        order.push_back(&t);
    }
    std::ranges::sort(order, [](const TensorData* a, const TensorData* b) {
        const uint64_t size_a = dtype_bytes(a->dtype), size_b = dtype_bytes(b->dtype);
        return size_a != size_b ? size_a > size_b : a->name < b->name;
    });

    const std::string header = header_text(order, metadata);
    std::byte length[8];
    for (int i = 0; i < 8; ++i)
        length[i] = static_cast<std::byte>(uint64_t(header.size()) >> (8 * i));
    SR_TRY(AtomicFile file, AtomicFile::create(path));
    SR_CHECK(file.write(length));
    SR_CHECK(file.write(header));
    for (const TensorData* t : order)
        SR_CHECK(file.write(t->bytes));
    return file.commit();
}

} // namespace semrover
