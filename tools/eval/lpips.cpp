// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/lpips.h"

#include "kernels/recognition.h"
#include "runtime/base/quote.h"
#include "runtime/device/executable.h"
#include "runtime/device/tensor_pool.h"
#include "tools/eval/folded_weights.h"

#include <cmath>
#include <cstring>
#include <optional>

namespace semrover {

namespace {

constexpr std::array<float, 3> kShift = {-.030f, -.088f, -.188f}, kScale = {.458f, .448f, .450f}; // lpips.py
constexpr float kEps = 1e-10f;                                                                    // of normalize_tensor

// a square convolution of the backbone, with a ReLU behind it
struct SquareConvolution {
    uint32_t index; // features.N
    uint32_t side, stride, padding, outputs;
};

// a pool or none, then convolutions; the features are what the last one gives
struct Stage {
    std::optional<PoolOptions> pool;
    std::vector<SquareConvolution> convolutions;
};

struct Backbone {
    std::string_view name;
    uint32_t least_side;
    std::vector<Stage> stages;
};

// source: torchvision's models/alexnet.py and vgg.py (configuration D), cut as lpips' pretrained_networks.py does;
// their pools round sizes down
Backbone alexnet()
{
    constexpr PoolOptions kPool{false, 3, 3, 2, 2, 0, 0};
    return {"alex",
            31,
            {{{}, {{0, 11, 4, 2, 64}}},
             {kPool, {{3, 5, 1, 2, 192}}},
             {kPool, {{6, 3, 1, 1, 384}}},
             {{}, {{8, 3, 1, 1, 256}}},
             {{}, {{10, 3, 1, 1, 256}}}}};
}

Backbone vgg16()
{
    constexpr PoolOptions kPool{false, 2, 2, 2, 2, 0, 0};
    return {"vgg",
            16,
            {{{}, {{0, 3, 1, 1, 64}, {2, 3, 1, 1, 64}}},
             {kPool, {{5, 3, 1, 1, 128}, {7, 3, 1, 1, 128}}},
             {kPool, {{10, 3, 1, 1, 256}, {12, 3, 1, 1, 256}, {14, 3, 1, 1, 256}}},
             {kPool, {{17, 3, 1, 1, 512}, {19, 3, 1, 1, 512}, {21, 3, 1, 1, 512}}},
             {kPool, {{24, 3, 1, 1, 512}, {26, 3, 1, 1, 512}, {28, 3, 1, 1, 512}}}}};
}

// by the first layer: 3 x 3 taps or 11 x 11
Backbone backbone_of(const SafetensorsSet& file)
{
    const TensorInfo* first = file.find("features.0.weight");
    return first && first->shape.size() == 4 && first->shape[3] == 3 ? vgg16() : alexnet();
}

FeatureMap image_of(const FeatureMap& x, uint32_t image)
{
    return {x.data.row_range(image * x.image_rows(), x.image_rows()), 1, x.height, x.width};
}

// over all pixels, by rows first: sums of fp32 stay short
FeatureMap mean(Graph& g, FeatureMap x)
{
    const FeatureMap of_rows = pool2d(g, x, {true, 1, x.width, 1, 1, 0, 0});
    return pool2d(g, of_rows, {true, x.height, 1, 1, 1, 0, 0});
}

} // namespace

struct Lpips::Impl {
    Device& device;
    FoldedWeights weights;
    Backbone backbone;
    std::vector<std::vector<uint32_t>> layers; // of each stage, numbers in weights
    std::vector<uint32_t> linear;

    // of pictures of one size
    struct Program {
        ImageSize size;
        TensorPool state;
        DeviceTensor pixels, figure;
        std::unique_ptr<Executable> executable;
    };
    std::optional<Program> program;

    Impl(Device& d, SafetensorsSet file, Backbone b) : device(d), weights(std::move(file)), backbone(std::move(b))
    {
        uint32_t channels = 3;
        for (const Stage& stage : backbone.stages) {
            std::vector<uint32_t>& own = layers.emplace_back();
            for (const SquareConvolution& c : stage.convolutions) {
                const FoldedWeights::Shape shape{
                    {c.side, c.side, c.padding, c.padding}, {channels}, c.outputs, true, 0};
                own.push_back(weights.add(fmt::format("features.{}", c.index), "", shape));
                channels = weights.outputs(own.back());
            }
            linear.push_back(
                weights.add(fmt::format("lin{}.model.1", linear.size()), "", {{1, 1, 0, 0}, {channels}, 1, false, 0}));
        }
    }
    FeatureMap convolve(Graph& g, FeatureMap x, const SquareConvolution& c, uint32_t layer) const
    {
        ConvOptions options;
        options.dtype = DType::f32;
        options.stride = c.stride;
        if (c.side != 3) // those of 3 x 3 may go through Winograd
            options.taps = {c.side, c.side, c.padding, c.padding};
        const FeatureMap y = convolution(g, x, weights.weight(g, layer), weights.bias(g, layer), options);
        return y.with(relu(g, y.data));
    }
    // [1 image of 1 pixel, 1]
    Tensor forward(Graph& g, FeatureMap x) const
    {
        Tensor sum;
        for (size_t i = 0; i < backbone.stages.size(); ++i) {
            const Stage& stage = backbone.stages[i];
            if (stage.pool)
                x = pool2d(g, x, *stage.pool);
            for (size_t j = 0; j < stage.convolutions.size(); ++j)
                x = convolve(g, x, stage.convolutions[j], layers[i][j]);
            const Tensor w = weights.weight(g, linear[i]);
            const Tensor layer = mean(g, unit_distance(g, image_of(x, 0), image_of(x, 1), w, kEps)).data;
            sum = sum.valid() ? add(g, layer, sum) : layer;
        }
        return sum;
    }
    Status prepare(ImageSize size)
    {
        if (program && program->size == size)
            return {};
        program.reset(); // its memory, before that of the next
        Program p;
        p.size = size;
        const uint32_t words = rgb_words(size.height, size.width);
        p.pixels = p.state.tensor(2, words, DType::u32, "pictures", words);
        p.figure = p.state.tensor(kImageRowPadding, 1, DType::f32, "distance");
        SR_CHECK(p.state.allocate(device, "pictures"));
        Graph g(device.limits());
        ResizeOptions scaled{size.height, size.width, size.height, size.width, DType::f32};
        scaled.shift = kShift;
        scaled.scale = kScale;
        g.keep(forward(g, resize_bilinear(g, p.pixels.in(g), scaled)), p.figure);
        SR_TRY(p.executable, Executable::create(device, std::move(g)));
        program = std::move(p);
        return {};
    }
};

Lpips::Lpips(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Lpips::~Lpips() = default;

Result<std::unique_ptr<Lpips>> Lpips::load(Device& device, const Path& path)
{
    SR_TRY(SafetensorsSet file, SafetensorsSet::open(path));
    Backbone backbone = backbone_of(file);
    auto impl = std::make_unique<Impl>(device, std::move(file), std::move(backbone));
    SR_CHECK(impl->weights.load(device, "features."));
    for (size_t i = 0; i < impl->linear.size(); ++i)
        if (const uint32_t outputs = impl->weights.outputs(impl->linear[i]); outputs != 1)
            return fail(ErrorCode::bad_input, "{}: lin{}.model.1.weight has {} outputs, expected 1", quote_path(path),
                        i, outputs);
    return std::unique_ptr<Lpips>(new Lpips(std::move(impl)));
}

std::string_view Lpips::backbone() const
{
    return impl_->backbone.name;
}

uint32_t Lpips::least_side() const
{
    return impl_->backbone.least_side;
}

Result<double> Lpips::distance(const ImageRgb8& a, const ImageRgb8& b)
{
    SR_ASSERT(a.width == b.width && a.height == b.height && std::min(a.width, a.height) >= least_side(),
              "pictures of {}x{} and {}x{}", a.width, a.height, b.width, b.height);
    SR_CHECK(impl_->prepare({a.width, a.height}));
    Impl::Program& p = *impl_->program;
    std::vector<uint32_t> words(p.pixels.bytes() / sizeof(uint32_t));
    std::memcpy(words.data(), a.pixels.data(), a.pixels.size());
    std::memcpy(&words[words.size() / 2], b.pixels.data(), b.pixels.size());
    SR_CHECK(p.pixels.write(impl_->device, words));
    SR_CHECK(p.executable->run());
    SR_TRY(const std::vector<float> figure, p.figure.read<float>(impl_->device));
    if (!std::isfinite(figure[0]))
        return fail(ErrorCode::internal, "the distance of two pictures is {}", figure[0]);
    return double(figure[0]);
}

} // namespace semrover
