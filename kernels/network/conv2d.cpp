// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[n] = bias[n] + sum over taps and channels of w[n, tap, c] x[pixel at tap, c]:
// x [images, H, W, C], w [N, taps * (C + C2)] -> y [images, H', W', N]
#include "kernels/network.h"

#include "conv2d.spv.h"
#include "kernels/network/matmul_tiles.h"
#include "split_k_reduce.spv.h"

#include <bit>

namespace semrover {

namespace {

// the taps of a square kernel: zeros all around, or to the right and below only
ConvOptions::Taps taps_of(const ConvOptions& o)
{
    if (o.taps.height)
        return o.taps;
    const uint32_t around = o.kernel == 1 || o.end_padding ? 0 : 1;
    return {o.kernel, o.kernel, around, around};
}

// how the output lies over the input
RowWindow window_of(FeatureMap x, const ConvOptions& o)
{
    const bool upsampled = o.upsampled_height != 0;
    const uint32_t height = upsampled ? o.upsampled_height : x.height;
    const uint32_t width = upsampled ? o.upsampled_width : x.width;
    SR_ASSERT(!upsampled || ((height + 1) / 2 == x.height && (width + 1) / 2 == x.width),
              "conv2d: {}x{} is not {}x{} times two", height, width, x.height, x.width);
    SR_ASSERT(!o.taps.height || (o.taps.width && !o.end_padding), "conv2d: {}x{} taps", o.taps.height, o.taps.width);
    const ConvOptions::Taps taps = taps_of(o);
    const uint32_t end = o.end_padding && o.kernel != 1;
    const uint32_t seen_height = height + 2 * taps.padding_y + end, seen_width = width + 2 * taps.padding_x + end;
    RowWindow w;
    w.stride = o.stride;
    w.kernel = taps.height;
    w.padding = taps.padding_y;
    w.shift = upsampled;
    w.in_height = height;
    w.in_width = x.width;
    w.in_image_rows = x.image_rows();
    SR_ASSERT(seen_height >= taps.height && seen_width >= taps.width, "conv2d: {}x{} image for {}x{} taps", height,
              width, taps.height, taps.width);
    w.out_height = (seen_height - taps.height) / o.stride + 1;
    w.out_width = (seen_width - taps.width) / o.stride + 1;
    w.out_image_rows = round_up(w.out_height * w.out_width, kImageRowPadding);
    return w;
}

// Sums over a long K by several workgroups, where few outputs would leave a large GPU idle: into how many slices K is
// cut. By the size of an image, and not by how many there are: an image has the same bits in any batch.
uint32_t slices_of(const KernelVariant& variant, const FeatureMap& y, uint32_t depth)
{
    constexpr uint32_t kTile = 64;           // of the output
    constexpr uint32_t kEnoughTiles = 128;   // of an image: from here on nothing is gained
    constexpr uint32_t kWantedTiles = 320;   // with slices
    constexpr uint32_t kLeastColumns = 1024; // of K, in a slice
    constexpr uint32_t kMostSlices = 16;
    if (!variant.constant("kSlices"))
        return 1;
    const uint32_t tiles = divide_up(y.image_rows(), kTile) * divide_up(y.channels(), kTile);
    if (tiles >= kEnoughTiles)
        return 1;
    const uint32_t most = std::min({kWantedTiles / tiles, depth / kLeastColumns, kMostSlices});
    return most ? std::bit_floor(most) : 1;
}

} // namespace

FeatureMap feature_map(Graph& g, uint32_t batch, uint32_t height, uint32_t width, uint32_t channels, DType dtype,
                       std::string_view name)
{
    FeatureMap map{{}, batch, height, width};
    map.data = g.matrix(batch * map.image_rows(), channels, dtype, name);
    return map;
}

FeatureMap frames_as_rows(const FeatureMap& x, uint32_t frames)
{
    SR_ASSERT(frames > 0 && x.batch % frames == 0, "{} images are no videos of {} frames", x.batch, frames);
    return {x.data, x.batch / frames, frames, x.image_rows()};
}

void split_k_reduce(Graph& g, Tensor sums, uint32_t slices, Tensor bias, const FeatureMap& y)
{
    SR_ASSERT(sums.rows == y.data.rows && sums.cols == slices * y.data.ld && sums.dtype == DType::f32,
              "split_k_reduce: [{}, {}] {} for {} slices of [{}, {}]", sums.rows, sums.cols, dtype_name(sums.dtype),
              slices, y.data.rows, y.data.ld);
    SplitKReducePush push{};
    push.rows = y.data.rows;
    push.cols = y.channels();
    push.image_rows = y.image_rows();
    push.x_ld = sums.ld;
    push.y_ld = y.data.ld;
    DispatchOptions dispatch;
    dispatch.constants = {{"kSlices", slices}, {"kBias", bias.valid()}};
    dispatch.banded = {"X", "Y"};
    dispatch.variant = &g.variant(kernel::split_k_reduce);
    g.dispatch(kernel::split_k_reduce, {{"X", sums}, {"Bias", bias}, {"Y", y.data}}, push,
               tiles(push.rows, push.cols, 1, fixed_tile(*dispatch.variant)), std::move(dispatch));
}

FeatureMap conv2d(Graph& g, FeatureMap x, FeatureMap x2, Tensor w, Tensor bias, const ConvOptions& options)
{
    const RowWindow window = window_of(x, options);
    const ConvOptions::Taps taps = taps_of(options);
    const FeatureMap y = feature_map(g, x.batch, window.out_height, window.out_width, w.rows, options.dtype, "conv2d");
    Conv2dPush push{};
    push.rows = y.data.rows;
    push.cols = w.rows;
    push.out_width = y.width;
    push.out_pixels = y.pixels();
    push.image_rows = y.image_rows();
    push.in_width = x.width;
    push.in_image_rows = x.image_rows();
    push.seen_width = window.shift ? options.upsampled_width : x.width;
    push.seen_height = window.in_height;
    push.stride = options.stride;
    push.padding_y = taps.padding_y;
    push.padding_x = taps.padding_x;
    push.shift = window.shift;
    push.x_ld = x.data.ld;
    push.x_cols = round_up(x.channels(), kRowPadding);
    push.w_ld = w.ld;
    if (x2.valid()) {
        SR_ASSERT(x2.batch == x.batch && x2.height == x.height && x2.width == x.width && x2.data.dtype == x.data.dtype,
                  "conv2d: inputs of {} x {}x{} and {} x {}x{}", x.batch, x.height, x.width, x2.batch, x2.height,
                  x2.width);
        push.x2_ld = x2.data.ld;
        push.x2_cols = round_up(x2.channels(), kRowPadding);
    }
    const uint32_t depth = taps.height * taps.width * (push.x_cols + push.x2_cols);
    SR_ASSERT(w.cols == depth, "conv2d: w [{}, {}] for {} columns", w.rows, w.cols, depth);
    SR_ASSERT(!bias.valid() || (bias.cols == w.rows && bias.dtype == DType::f32), "conv2d: bias [{}, {}] for {}",
              bias.rows, bias.cols, w.rows);
    DispatchOptions dispatch;
    dispatch.flops = 2.0 * x.batch * y.pixels() * w.rows * taps.height * taps.width *
                     (x.channels() + (x2.valid() ? x2.channels() : 0));
    dispatch.variant = &g.variant(kernel::conv2d, {}, std::vector{x.data, w});
    SR_ASSERT(!options.slices || dispatch.variant->constant("kSlices"), "conv2d: {} has no slices of K",
              dispatch.variant->name);
    const uint32_t slices = options.slices ? options.slices : slices_of(*dispatch.variant, y, depth);
    const bool sliced = slices > 1;
    const Tensor out = sliced ? g.matrix(y.data.rows, slices * y.data.ld, DType::f32, "slices") : y.data;
    push.y_ld = out.ld;
    MatmulTiles made = matmul_tiles(
        *dispatch.variant, g.limits(),
        {push.rows, push.cols, slices, {push.x_cols, push.x2_cols}, is_little(dispatch.flops)}, options.tile);
    push.col_lanes = made.col_lanes;
    dispatch.alternatives = std::move(made.alternatives);
    dispatch.constants = group_constants(g.limits(), {{"kKernelHeight", taps.height},
                                                      {"kKernelWidth", taps.width},
                                                      {"kTwoInputs", x2.valid()},
                                                      {"kBias", bias.valid() && !sliced},
                                                      {"kSlices", slices}});
    dispatch.banded = {{"X", window}, "Y"};
    if (x2.valid())
        dispatch.banded.push_back({"X2", window});
    g.dispatch(kernel::conv2d, {{"X", x.data}, {"X2", x2.data}, {"W", w}, {"Bias", bias}, {"Y", out}}, push,
               tiles(push.rows, push.cols, slices), std::move(dispatch));
    if (sliced)
        split_k_reduce(g, out, slices, bias, y);
    return y;
}

} // namespace semrover
