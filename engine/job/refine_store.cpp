// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/refine_store.h"

#include "runtime/base/quote.h"
#include "runtime/base/safetensors.h"

#include <cstring>

namespace semrover {

namespace {

constexpr const char* kFolders[] = {"encoded", "latents", "frames"};

} // namespace

Status write_latent(const Path& path, const LatentSize& size, std::span<const float> latent)
{
    const uint64_t channels = latent.size() / size.pixels();
    const TensorData tensor{"latent", DType::f32, {size.height(), size.width(), channels}, std::as_bytes(latent)};
    return write_safetensors(path, {&tensor, 1});
}

Result<std::vector<float>> read_latent(const Path& path, const LatentSize& size, uint32_t channels)
{
    SR_TRY(const Safetensors file, Safetensors::open(path));
    SR_TRY(const TensorInfo* info, file.get("latent"));
    const std::vector<uint64_t> shape{size.height(), size.width(), channels};
    if (info->dtype != DType::f32 || info->shape != shape)
        return fail(ErrorCode::bad_input, "{}: expected a latent F32 [{}], found {} [{}]", quote_path(path),
                    fmt::join(shape, ", "), dtype_name(info->dtype), fmt::join(info->shape, ", "));
    const auto bytes = file.bytes(*info);
    if (const auto at = first_non_finite(bytes, DType::f32))
        return fail(ErrorCode::bad_input, "{}: the latent holds NaN or infinity at element {}", quote_path(path), *at);
    std::vector<float> latent(bytes.size() / 4);
    std::memcpy(latent.data(), bytes.data(), bytes.size());
    return latent;
}

RefineStore::RefineStore(RunFolder& run, FrameFormat format, uint32_t channels)
    : folder_(run.path()), format_(format), channels_(channels),
      record_(run, [folder = run.path()](const std::string& piece) { return std::vector<Path>{folder / piece}; })
{
}

std::string RefineStore::name(PieceKind kind, const BufferCamera& camera, uint32_t frame) const
{
    return fmt::format("{}/{}{}{:06}.{}", kFolders[int(kind)], camera.name, camera.name.empty() ? "" : "/", frame,
                       kind == PieceKind::frame ? format_.extension() : "safetensors");
}

Path RefineStore::path(PieceKind kind, const BufferCamera& camera, uint32_t frame) const
{
    return folder_ / name(kind, camera, frame);
}

bool RefineStore::has(PieceKind kind, const BufferCamera& camera, uint32_t frame) const
{
    return record_.has(name(kind, camera, frame));
}

Status RefineStore::save_latent(PieceKind kind, const BufferCamera& camera, uint32_t frame, const LatentSize& size,
                                std::span<const float> latent)
{
    const Path to = path(kind, camera, frame);
    SR_CHECK(make_folder(to.parent_path()));
    SR_CHECK(write_latent(to, size, latent));
    return record_.add(name(kind, camera, frame));
}

Result<std::vector<float>> RefineStore::load_latent(PieceKind kind, const BufferCamera& camera, uint32_t frame,
                                                    const LatentSize& size) const
{
    return read_latent(path(kind, camera, frame), size, channels_);
}

Status RefineStore::save_frame(const BufferCamera& camera, uint32_t frame, std::span<const uint8_t> pixels)
{
    const Path to = path(PieceKind::frame, camera, frame);
    SR_CHECK(make_folder(to.parent_path()));
    SR_CHECK(format_.jpeg ? write_jpeg_rgb8(to, camera.size.width, camera.size.height, pixels, format_.quality)
                          : write_png_rgb8(to, camera.size.width, camera.size.height, pixels));
    return record_.add(name(PieceKind::frame, camera, frame));
}

Result<ImageRgb8> RefineStore::load_frame(const BufferCamera& camera, uint32_t frame) const
{
    const Path from = path(PieceKind::frame, camera, frame);
    return format_.jpeg ? read_jpeg_rgb8(from) : read_png_rgb8(from);
}

} // namespace semrover
