// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/inception.h"

#include "kernels/recognition.h"
#include "runtime/device/executable.h"
#include "runtime/device/tensor_pool.h"

#include <cmath>
#include <cstring>

namespace semrover {

struct ImageFeatures::Impl {
    Device& device;
    const Inception& network;
    ImageSize size;
    uint32_t batch;
    TensorPool state;
    DeviceTensor pixels, features;
    std::unique_ptr<Executable> executable;

    Impl(Device& d, const Inception& n, ImageSize s, uint32_t b) : device(d), network(n), size(s), batch(b)
    {
        pixels = state.tensor(batch, words(), DType::u32, "images", words());
        Graph sizes(device.limits()); // to know how large the result is
        const Tensor y = forward(sizes);
        features = state.tensor(y.rows, y.cols, DType::f32, "features");
    }
    uint32_t words() const { return rgb_words(size.height, size.width); }
    Tensor forward(Graph& g) const
    {
        const ResizeOptions resize{size.height, size.width, kInceptionSide, kInceptionSide, DType::f32};
        return network.forward(g, resize_bilinear(g, pixels.in(g), resize)).data;
    }
    Graph graph() const
    {
        Graph g(device.limits());
        g.keep(forward(g), features);
        return g;
    }
    // arrays and transients; nothing is allocated yet
    Result<uint64_t> planned_bytes() const
    {
        SR_TRY(const Plan plan, make_plan(graph()));
        return state.planned_bytes(device.limits()) + plan.arena_bytes();
    }
    Status allocate()
    {
        SR_CHECK(state.allocate(device, "images and features"));
        SR_TRY(executable, Executable::create(device, graph()));
        return {};
    }
};

ImageFeatures::ImageFeatures(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ImageFeatures::~ImageFeatures() = default;

Result<std::unique_ptr<ImageFeatures>> ImageFeatures::create(Device& device, const Inception& network, ImageSize size,
                                                             uint32_t batch)
{
    SR_ASSERT(batch >= 1 && size.width && size.height, "{} images of {}x{}", batch, size.width, size.height);
    for (;; batch = (batch + 1) / 2) {
        auto impl = std::make_unique<Impl>(device, network, size, batch);
        const auto bytes = impl->planned_bytes();
        const bool fits = bytes && (!device.budget() || device.allocated_bytes() + *bytes <= device.budget());
        if (!fits && batch > 1)
            continue;
        SR_CHECK(impl->allocate());
        return std::unique_ptr<ImageFeatures>(new ImageFeatures(std::move(impl)));
    }
}

uint32_t ImageFeatures::batch() const
{
    return impl_->batch;
}

Status ImageFeatures::append(std::span<const ImageRgb8> images, Features& features)
{
    Impl& m = *impl_;
    SR_ASSERT(!images.empty() && images.size() <= m.batch, "{} images for a batch of {}", images.size(), m.batch);
    std::vector<uint32_t> words(size_t(m.batch) * m.words());
    for (size_t i = 0; i < m.batch; ++i) { // a batch that is not full repeats its last image
        const ImageRgb8& image = images[std::min(i, images.size() - 1)];
        SR_ASSERT(image.width == m.size.width && image.height == m.size.height, "an image of {}x{}", image.width,
                  image.height);
        std::memcpy(&words[i * m.words()], image.pixels.data(), image.pixels.size());
    }
    SR_CHECK(m.pixels.write(m.device, words));
    SR_CHECK(m.executable->run());
    SR_TRY(const std::vector<float> rows, m.features.read<float>(m.device));
    const uint32_t ld = m.features.ld();
    for (size_t i = 0; i < images.size(); ++i) {
        const std::span<const float> row(&rows[i * (m.features.rows() / m.batch) * ld], ld);
        const std::vector<double> values = m.network.unpadded(row);
        for (const double v : values)
            if (!std::isfinite(v))
                return fail(ErrorCode::internal, "a feature of image {} of the batch is {}", i, v);
        features.values.insert(features.values.end(), values.begin(), values.end());
        features.cols = uint32_t(values.size());
        ++features.rows;
    }
    return {};
}

} // namespace semrover
