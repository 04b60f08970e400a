// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/refine_store.h"

#include "runtime/base/quote.h"
#include "runtime/base/safetensors.h"

#include <cstring>

namespace semrover {

namespace {

constexpr const char* kFolders[] = {"encoded", "latents", "frames"};
constexpr uint32_t kDepthsKept = 3; // of a camera: the renderer asks for a frame's and for that of the one before

const RefinedCamera& camera_of(const CameraChain& chain)
{
    return static_cast<const RefinedCamera&>(chain);
}

// a buffer's files as splat_pixels() would make them
std::vector<uint32_t> seen_words(const BufferFrame& buffer)
{
    std::vector<uint32_t> words(buffer.visible.size());
    for (size_t i = 0; i < words.size(); ++i)
        words[i] = buffer.color[3 * i] | uint32_t(buffer.color[3 * i + 1]) << 8 |
                   uint32_t(buffer.color[3 * i + 2]) << 16 | (buffer.visible[i] ? 255u << 24 : 0u);
    return words;
}

} // namespace

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

RefineStore::RefineStore(RunFolder& run, const PictureEncoding& encoding, uint32_t channels)
    : folder_(run.path()), encoding_(encoding), channels_(channels),
      record_(run, [folder = run.path()](const std::string& piece) { return std::vector<Path>{folder / piece}; })
{
}

std::string RefineStore::name(PieceKind kind, const BufferCamera& camera, uint32_t frame) const
{
    return fmt::format("{}/{}{}{:06}.{}", kFolders[int(kind)], camera.name, camera.name.empty() ? "" : "/", frame,
                       kind == PieceKind::frame ? encoding_.color_extension() : "safetensors");
}

Path RefineStore::path(PieceKind kind, const BufferCamera& camera, uint32_t frame) const
{
    return folder_ / name(kind, camera, frame);
}

bool RefineStore::has(PieceKind kind, const BufferCamera& camera, uint32_t frame) const
{
    return record_.has(name(kind, camera, frame));
}

Result<FileQueue::Commit> RefineStore::make(std::string piece, std::span<const std::byte> bytes)
{
    const auto files = std::make_shared<MadeFiles>();
    SR_CHECK(files->add(folder_ / piece, bytes));
    return [this, piece = std::move(piece), files] { return record_.add(piece, *files); };
}

Result<FileQueue::Commit> RefineStore::make_latent(PieceKind kind, const BufferCamera& camera, uint32_t frame,
                                                   const LatentSize& size, std::span<const float> latent)
{
    const uint64_t channels = latent.size() / size.pixels();
    const TensorData tensor{"latent", DType::f32, {size.height(), size.width(), channels}, std::as_bytes(latent)};
    return make(name(kind, camera, frame), encode_safetensors({&tensor, 1}));
}

Result<std::vector<float>> RefineStore::load_latent(PieceKind kind, const BufferCamera& camera, uint32_t frame,
                                                    const LatentSize& size) const
{
    return read_latent(path(kind, camera, frame), size, channels_);
}

Result<FileQueue::Commit> RefineStore::make_frame(const BufferCamera& camera, uint32_t frame,
                                                  std::span<const uint8_t> pixels)
{
    SR_TRY(const std::vector<std::byte> file, encode_color(encoding_, camera.size, pixels));
    return make(name(PieceKind::frame, camera, frame), file);
}

Result<ImageRgb8> RefineStore::load_frame(const BufferCamera& camera, uint32_t frame) const
{
    return read_image_rgb8(path(PieceKind::frame, camera, frame));
}

void RefineFiles::give_buffer(const std::string& camera, uint32_t frame, const DeviceTensor& seen)
{
    Given& given = given_[camera];
    given.seen = seen;
    given.buffers = frame + 1;
}

void RefineFiles::give_depth(const std::string& camera, uint32_t frame, DepthPicture depth)
{
    std::map<uint32_t, DepthPicture>& latest = given_[camera].latest;
    latest[frame] = std::move(depth);
    if (frame >= kDepthsKept)
        latest.erase(latest.begin(), latest.lower_bound(frame + 1 - kDepthsKept));
}

bool RefineFiles::waits_for(const FrameTask& task) const
{
    if (!drawn_ || task.part == FramePart::decode)
        return false;
    const auto given = given_.find(task.chain->name);
    return given == given_.end() || given->second.buffers <= task.frame();
}

Status RefineFiles::read_seen(const CameraChain& chain, uint32_t frame, const DeviceTensor& to)
{
    if (!drawn_) {
        SR_TRY(const BufferFrame buffer, read_buffer(camera_of(chain).buffers, frame));
        return to.write(device_, seen_words(buffer));
    }
    if (!copies_) {
        SR_TRY(copies_, CopyRing::create(device_));
    }
    return copies_->copy(given_[chain.name].seen, to).map([](uint64_t) {});
}

Result<FrameView> RefineFiles::view(const CameraChain& chain, uint32_t frame)
{
    const RefinedCamera& c = camera_of(chain);
    if (drawn_)
        SR_CHECK(out_.arrive()); // with what was drawn
    std::map<uint32_t, DepthPicture>& latest = given_[c.name].latest;
    const auto found = latest.find(frame);
    if (found != latest.end())
        return FrameView{c.cameras[frame], found->second};
    if (drawn_)
        SR_CHECK(out_.drain());
    SR_TRY(DepthPicture depth, read_depth(c.buffers, frame));
    if (!drawn_) {
        latest.erase(latest.begin(), latest.lower_bound(frame > 0 ? frame - 1 : 0));
        latest[frame] = depth;
    }
    return FrameView{c.cameras[frame], std::move(depth)};
}

Status RefineFiles::save_frame(const CameraChain& chain, uint32_t frame, const DeviceTensor& pixels)
{
    return out_.read(pixels, [this, &c = camera_of(chain), frame](std::span<const std::byte> read) {
        const auto* first = reinterpret_cast<const uint8_t*>(read.data());
        const size_t count = size_t(c.size().image_width) * c.size().image_height * 3;
        return out_.write(count, [this, &c, frame, bytes = std::vector<uint8_t>(first, first + count)] {
            return store_.make_frame(c.buffers, frame, bytes);
        });
    });
}

Status RefineFiles::save(PieceKind kind, const CameraChain& chain, uint32_t frame, std::vector<float> latent)
{
    const uint64_t bytes = latent.size() * 4;
    return out_.write(bytes, [this, kind, &c = camera_of(chain), frame, values = std::move(latent)] {
        return store_.make_latent(kind, c.buffers, frame, c.size(), values);
    });
}

Status RefineFiles::save_latent(const CameraChain& chain, uint32_t frame, const std::vector<float>& latent)
{
    return save(PieceKind::latent, chain, frame, latent);
}

Status RefineFiles::save_encoded(const CameraChain& chain, uint32_t frame, std::vector<float> latent)
{
    return save(PieceKind::encoded, chain, frame, std::move(latent));
}

Result<EncodedBuffer> RefineFiles::load_encoded(const CameraChain& chain, uint32_t frame)
{
    const RefinedCamera& c = camera_of(chain);
    SR_TRY(const BufferFrame buffer, read_buffer(c.buffers, frame));
    SR_TRY(std::vector<float> latent, store_.load_latent(PieceKind::encoded, c.buffers, frame, c.size()));
    return EncodedBuffer{std::move(latent), block_shares(c.size(), buffer.visible)};
}

Result<std::vector<float>> RefineFiles::load_latent(const CameraChain& chain, uint32_t frame)
{
    const RefinedCamera& c = camera_of(chain);
    if (frame >= c.first)
        return store_.load_latent(PieceKind::latent, c.buffers, frame, c.size());
    const size_t size = c.latents_before.size() / c.before;
    const auto first = c.latents_before.begin() + std::ptrdiff_t((frame + c.before - c.first) * size);
    return std::vector<float>(first, first + std::ptrdiff_t(size));
}

Result<std::vector<uint8_t>> RefineFiles::load_frame(const CameraChain& chain, uint32_t frame)
{
    const RefinedCamera& c = camera_of(chain);
    if (frame < c.first)
        return c.picture_before;
    if (!store_.lossless())
        return std::vector<uint8_t>{};
    SR_TRY(ImageRgb8 picture, store_.load_frame(c.buffers, frame));
    return std::move(picture.pixels);
}

} // namespace semrover
