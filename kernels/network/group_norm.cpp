// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (x - mean) / sqrt(var + eps) * weight + bias per image, or per set of images, and group of channels, then SiLU:
// [images, H, W, C], [images, H, W, C2] -> [images, H, W, C + C2]
#include "kernels/network.h"

#include "group_norm_apply.spv.h"
#include "group_norm_scale.spv.h"
#include "shaders/network/group_norm.h"

namespace semrover {

namespace {

// scale and mean of every channel of every set of images: [2 * sets, C + C2]
Tensor channel_scale(Graph& g, NormInput x, NormInput x2, Tensor weight, const GroupNormOptions& options)
{
    const uint32_t cols = weight.cols, sets = x.x.batch / options.images;
    const Tensor scale = g.matrix(2 * sets, cols, DType::f32, "group_norm scale");
    GroupNormScalePush push{};
    push.pixels = x.x.pixels();
    push.chunks = x.x.image_rows() / kImageRowPadding;
    push.images = options.images;
    push.x_cols = x.x.channels();
    push.moments_ld = x.moments.ld;
    push.moments2_ld = x2.moments.valid() ? x2.moments.ld : 0;
    push.x2_cols = x2.x.valid() ? x2.x.channels() : 0;
    push.scale_ld = scale.ld;
    push.group_cols = cols / options.groups;
    push.eps = options.eps;
    g.dispatch(kernel::group_norm_scale, {x.moments, x2.moments.valid() ? x2.moments : x.moments, weight, scale}, push,
               groups(options.groups, sets));
    return scale;
}

} // namespace

FeatureMap group_norm(Graph& g, NormInput x, NormInput x2, Tensor weight, Tensor bias, const GroupNormOptions& options)
{
    const uint32_t cols = x.x.channels() + (x2.x.valid() ? x2.x.channels() : 0);
    SR_ASSERT(weight.cols == cols && bias.cols == cols && cols % options.groups == 0,
              "group_norm: {} channels, {} groups, weight of {}, bias of {}", cols, options.groups, weight.cols,
              bias.cols);
    SR_ASSERT(options.images > 0 && x.x.batch % options.images == 0, "group_norm: sets of {} of {} images",
              options.images, x.x.batch);
    SR_ASSERT(!x2.x.valid() || (x2.x.data.rows == x.x.data.rows && x2.x.data.dtype == x.x.data.dtype &&
                                x.x.channels() % kRowPadding == 0),
              "group_norm: a second input of {} rows beside {} rows of {} channels", x2.x.data.rows, x.x.data.rows,
              x.x.channels());
    const Tensor scale = channel_scale(g, x, x2, weight, options);
    const FeatureMap y = x.x.with(g.matrix(x.x.data.rows, cols, options.dtype, "group_norm"));
    GroupNormApplyPush push{};
    push.rows = y.data.rows;
    push.x_cols = x.x.channels();
    push.x2_cols = cols - push.x_cols;
    push.image_rows = options.images * y.image_rows();
    push.x_ld = x.x.data.ld;
    push.x2_ld = x2.x.valid() ? x2.x.data.ld : 0;
    push.y_ld = y.data.ld;
    push.scale_ld = scale.ld;
    DispatchOptions dispatch;
    dispatch.constants = {{"kSilu", options.silu}};
    dispatch.banded = {"X", "Y"};
    if (x2.x.valid())
        dispatch.banded.push_back("X2");
    g.dispatch(kernel::group_norm_apply,
               {x.x.data, x2.x.valid() ? x2.x.data : x.x.data.row_range(0, 1), scale, bias, y.data}, push,
               threads(y.data.rows * divide_up(cols, 8)), std::move(dispatch));
    return y;
}

} // namespace semrover
