// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (x - mean) / sqrt(var + eps) * weight + bias per image, or per set of images, and group of channels, then SiLU:
// [images, H, W, C], [images, H, W, C2] -> [images, H, W, C + C2]
#include "kernels/network.h"

#include "group_norm_apply.spv.h"
#include "group_norm_merge.spv.h"
#include "group_norm_scale.spv.h"

namespace semrover {

namespace {

// One workgroup reads the moments of a group, at some thousands a microsecond. Where it has more, a pass before it
// merges chunks, which costs about five microseconds.
constexpr uint64_t kMostMoments = 8192;
constexpr uint32_t kTogether = 16; // chunks
constexpr uint32_t kApplyRows = 4; // of a thread of group_norm_apply

struct ChunkMoments {
    Tensor x, x2;
    uint32_t chunks, chunk_rows; // of an image
};

Tensor merge_chunks(Graph& g, NormInput x)
{
    const uint32_t chunks = x.x.image_rows() / kImageRowPadding, merged = divide_up(chunks, kTogether);
    const Tensor y = g.matrix(x.x.batch * merged, x.moments.cols, DType::f32, "merged moments");
    GroupNormMergePush push{};
    push.rows = y.rows;
    push.merged = merged;
    push.together = kTogether;
    push.pixels = x.x.pixels();
    push.chunks = chunks;
    push.cols = x.x.channels();
    push.moments_ld = x.moments.ld;
    push.merged_ld = y.ld;
    g.dispatch(kernel::group_norm_merge, {{"Moments", x.moments}, {"Merged", y}}, push, threads(y.rows * push.cols));
    return y;
}

ChunkMoments chunk_moments(Graph& g, NormInput x, NormInput x2, uint32_t group_cols, uint32_t images)
{
    const uint32_t chunks = x.x.image_rows() / kImageRowPadding;
    ChunkMoments m{x.moments, x2.moments, chunks, kImageRowPadding};
    if (uint64_t(chunks) * images * group_cols > kMostMoments) {
        m = {merge_chunks(g, x), x2.moments.valid() ? merge_chunks(g, x2) : Tensor{}, divide_up(chunks, kTogether),
             kTogether * kImageRowPadding};
    }
    return m;
}

// scale and mean of every channel of every set of images: [2 * sets, C + C2]
Tensor channel_scale(Graph& g, NormInput x, NormInput x2, Tensor weight, const GroupNormOptions& options)
{
    const uint32_t cols = weight.cols, sets = x.x.batch / options.images, group_cols = cols / options.groups;
    const ChunkMoments moments = chunk_moments(g, x, x2, group_cols, options.images);
    const Tensor scale = g.matrix(2 * sets, cols, DType::f32, "group_norm scale");
    GroupNormScalePush push{};
    push.pixels = x.x.pixels();
    push.chunks = moments.chunks;
    push.chunk_rows = moments.chunk_rows;
    push.images = options.images;
    push.x_cols = x.x.channels();
    push.moments_ld = moments.x.ld;
    push.moments2_ld = moments.x2.valid() ? moments.x2.ld : 0;
    push.x2_cols = x2.x.valid() ? x2.x.channels() : 0;
    push.scale_ld = scale.ld;
    push.group_cols = group_cols;
    push.eps = options.eps;
    g.dispatch(kernel::group_norm_scale,
               {{"Moments", moments.x}, {"Moments2", moments.x2}, {"Weight", weight}, {"Scale", scale}}, push,
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
               {{"X", x.x.data}, {"X2", x2.x.data}, {"Scale", scale}, {"Bias", bias}, {"Y", y.data}}, push,
               threads(divide_up(y.data.rows, kApplyRows) * divide_up(cols, 8), kApplyRows), std::move(dispatch));
    return y;
}

} // namespace semrover
