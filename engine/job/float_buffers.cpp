// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/float_buffers.h"

#include "engine/format/npy.h"

namespace semrover {

namespace {

Status write_plane(const Path& folder, const char* kind, uint32_t number, const SplatImage& image,
                   const std::vector<float>& values)
{
    SR_CHECK(make_folder(folder / kind));
    const auto bytes = std::as_bytes(std::span(values));
    return write_file_atomically(folder / kind / fmt::format("{:06}.npy", number),
                                 encode_npy({DType::f32, {image.height, image.width}, {bytes.begin(), bytes.end()}}));
}

} // namespace

Status FloatBuffers::write(const Path& folder, uint32_t number, const CameraFrame& frame)
{
    const Intrinsics& k = frame.intrinsics;
    auto& rasterizer = rasterizers_[{k.width, k.height, k.model}];
    if (!rasterizer) {
        RasterizerOptions options = options_;
        options.model = k.model;
        SR_TRY(rasterizer, Rasterizer::create(device_, scene_, k.width, k.height, 1, options));
    }
    const SplatCamera camera = splat_camera(k, frame.pose);
    SR_TRY(const std::vector<SplatImage> images, rasterizer->render({&camera, 1}));
    const SplatImage& image = images.front();
    SR_CHECK(write_plane(folder, "depth_expected", number, image, image.depth_expected));
    SR_CHECK(write_plane(folder, "depth_median", number, image, image.depth_median));
    return write_plane(folder, "alpha", number, image, image.alpha);
}

} // namespace semrover
