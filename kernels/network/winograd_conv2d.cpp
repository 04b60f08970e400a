// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[n] = bias[n] + sum over 3 x 3 taps and channels, from 36 products per channel and tile of 4 x 4 pixels:
// U = G w G^T [36 * N, C],
// V = B^T x B [36 * tiles, C], m = V U^T per product [36 * tiles, N], y = A^T m A + bias + shift + residual
#include "kernels/network.h"

#include "winograd_input.spv.h"
#include "winograd_output.spv.h"
#include "winograd_weight.spv.h"

namespace semrover {

namespace {

constexpr uint64_t kBandBytes = 64 << 20; // of V and m, about: larger images are done in bands of tiles
constexpr uint32_t kBandTiles = 32;       // a band is a multiple: rows of a GEMM tile on CPUs

constexpr uint32_t kFewestTiles = 32;    // of an image; guidance has two
constexpr uint64_t kFewestChannels = 24; // N C / (N + C)

struct Tiling {
    uint32_t across, per_image, total;
};

void check(const FeatureMap& x, const Tensor& u, const Tensor& bias, const ConvOptions& o)
{
    SR_ASSERT(o.kernel == 3 && o.stride == 1 && !o.end_padding && !o.taps.height,
              "winograd_conv2d: kernel {} stride {}", o.kernel, o.stride);
    SR_ASSERT(u.rows % 36 == 0 && u.cols == round_up(x.channels(), kRowPadding) && u.dtype == DType::f32,
              "winograd_conv2d: u [{}, {}] {} for {} channels", u.rows, u.cols, dtype_name(u.dtype), x.channels());
    SR_ASSERT(!bias.valid() || (bias.cols == u.rows / 36 && bias.dtype == DType::f32),
              "winograd_conv2d: bias [{}, {}] for {}", bias.rows, bias.cols, u.rows / 36);
    SR_ASSERT(
        o.upsampled_height == 0 || ((o.upsampled_height + 1) / 2 == x.height && (o.upsampled_width + 1) / 2 == x.width),
        "winograd_conv2d: {}x{} is not {}x{} times two", o.upsampled_height, o.upsampled_width, x.height, x.width);
}

// the image that the taps see, and that comes out
FeatureMap seen_image(const FeatureMap& x, const ConvOptions& o)
{
    const bool up = o.upsampled_height != 0;
    return {{}, x.batch, up ? o.upsampled_height : x.height, up ? o.upsampled_width : x.width};
}

Tiling tiling_of(const FeatureMap& y)
{
    Tiling t{};
    t.across = divide_up(y.width, 4);
    t.per_image = t.across * divide_up(y.height, 4);
    t.total = t.per_image * y.batch;
    return t;
}

Tensor transform_input(Graph& g, const FeatureMap& x, const ConvOptions& o, const Tiling& t, uint32_t first,
                       uint32_t count)
{
    const bool upsampled = o.upsampled_height != 0;
    const Tensor v = g.matrix(36 * count, round_up(x.channels(), kRowPadding), DType::f32, "winograd_input");
    WinogradInputPush push{};
    push.first_tile = first;
    push.tiles = count;
    push.tiles_x = t.across;
    push.image_tiles = t.per_image;
    push.image_rows = x.image_rows();
    push.width = x.width;
    push.seen_height = upsampled ? o.upsampled_height : x.height;
    push.seen_width = upsampled ? o.upsampled_width : x.width;
    push.shift = upsampled;
    push.cols = v.cols;
    push.x_ld = x.data.ld;
    push.v_ld = v.ld;
    g.dispatch(kernel::winograd_input, {{"X", x.data}, {"V", v}}, push, threads(count * (v.cols / 4)));
    return v;
}

void transform_output(Graph& g, Tensor m, Tensor bias, const ConvAddends& add, const FeatureMap& y, const Tiling& t,
                      uint32_t first, uint32_t count)
{
    WinogradOutputPush push{};
    push.first_tile = first;
    push.tiles = count;
    push.tiles_x = t.across;
    push.image_tiles = t.per_image;
    push.image_rows = y.image_rows();
    push.height = y.height;
    push.width = y.width;
    push.cols = round_up(y.channels(), kRowPadding);
    push.outputs = y.channels();
    push.m_ld = m.ld;
    push.y_ld = y.data.ld;
    push.shift_ld = add.shift.table.ld;
    push.shift_col = add.shift.col;
    push.residual_ld = add.residual.data.ld;
    const bool shifted = add.shift.table.valid(), added = add.residual.valid();
    DispatchOptions options;
    options.constants = {{"kBias", bias.valid()}, {"kShift", shifted}, {"kAdd", added}};
    g.dispatch(kernel::winograd_output,
               {{"M", m},
                {"Bias", bias},
                {"Y", y.data},
                {"Shift", add.shift.table},
                {"ShiftRow", add.shift.table_row},
                {"Residual", add.residual.data}},
               push, threads(count * (push.cols / 4)), std::move(options));
}

} // namespace

Tensor winograd_weight(Graph& g, Tensor w)
{
    const uint32_t cols = w.cols / 9;
    SR_ASSERT(w.cols % (9 * kRowPadding) == 0, "winograd_weight: {} columns for nine taps", w.cols);
    const Tensor u = g.matrix(36 * w.rows, cols, DType::f32, "winograd_weight");
    const WinogradWeightPush push{.outputs = w.rows, .cols = cols, .w_ld = w.ld, .u_ld = u.ld};
    g.dispatch(kernel::winograd_weight, {{"W", w}, {"U", u}}, push, threads(w.rows * (cols / 4)));
    return u;
}

FeatureMap winograd_conv2d(Graph& g, FeatureMap x, Tensor u, Tensor bias, const ConvOptions& o, const ConvAddends& add)
{
    check(x, u, bias, o);
    FeatureMap y = seen_image(x, o);
    y.data = g.matrix(y.batch * y.image_rows(), u.rows / 36, o.dtype, "winograd_conv2d");
    SR_ASSERT(!add.residual.valid() ||
                  (add.residual.data.rows == y.data.rows && add.residual.channels() == y.channels()),
              "winograd_conv2d: a residual [{}, {}] for [{}, {}]", add.residual.data.rows, add.residual.channels(),
              y.data.rows, y.channels());
    const Tiling t = tiling_of(y);
    const uint64_t tile_bytes = 36 * sizeof(float) * (u.cols + y.channels());
    const uint32_t fitting = uint32_t(kBandBytes / tile_bytes) / kBandTiles * kBandTiles;
    const uint32_t bands = divide_up(t.total, std::max(fitting, kBandTiles));
    const uint32_t band = round_up(divide_up(t.total, bands), kBandTiles);
    for (uint32_t first = 0; first < t.total; first += band) {
        const uint32_t count = std::min(band, t.total - first);
        const Tensor v = transform_input(g, x, o, t, first, count);
        const Tensor m = gemm(g, v, u, {}, {.groups = 36, .dtype = DType::f32});
        transform_output(g, m, bias, add, y, t, first, count);
    }
    return y;
}

bool prefers_winograd(const DeviceLimits& limits, const FeatureMap& x, uint32_t outputs, const ConvOptions& o)
{
    if (limits.type != DeviceType::cpu || o.kernel != 3 || o.stride != 1 || o.taps.height)
        return false;
    const FeatureMap y = seen_image(x, o);
    const uint64_t n = outputs, c = round_up(x.channels(), kRowPadding), rows = uint64_t(y.batch) * y.image_rows();
    const uint64_t texel_bytes = limits.max_texel_elements * 16, most = std::min(limits.max_storage_range, texel_bytes);
    if (36 * n * c * 4 > most || rows * round_up(outputs, kRowPadding) * dtype_bytes(o.dtype) > most ||
        kBandBytes + (kBandTiles * 36 * 4 * (n + c)) > most || x.data.bytes() > texel_bytes)
        return false;
    // Tiles pay for the transform of the weights, channels for those of the image. Of one image: the same bits whatever
    // it is packed with.
    return tiling_of(y).per_image >= kFewestTiles && n * c >= kFewestChannels * (n + c);
}

} // namespace semrover
