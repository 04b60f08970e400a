// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// truncated signed distance of depth images in sparse blocks of 8^3 voxels: planes through pixels, blocks they touch,
// D = sum of w min(d / t, 1), W = sum of w, d = (1 - N p) / |N|, in order of frames, one thread a voxel
#include "kernels/fusion.h"

#include "kernels/sort.h"
#include "tsdf_count.spv.h"
#include "tsdf_finish.spv.h"
#include "tsdf_integrate.spv.h"
#include "tsdf_list.spv.h"
#include "tsdf_planes.spv.h"
#include "tsdf_touch.spv.h"

namespace semrover {

namespace {

TsdfPush make_push(const TsdfOptions& o, uint32_t rows, uint32_t frames)
{
    SR_ASSERT(o.voxel > 0 && o.truncation > 0 && o.band > 0 && o.band <= o.truncation && o.max_depth > 0,
              "tsdf: voxels of {} m, truncation {} m, band {} m, depth to {} m", o.voxel, o.truncation, o.band,
              o.max_depth);
    SR_ASSERT(uint64_t(o.blocks_x) * o.blocks_y * o.blocks_z < 1ull << 32, "tsdf: a box of {} x {} x {} blocks",
              o.blocks_x, o.blocks_y, o.blocks_z);
    return {.rows = rows,
            .frames = frames,
            .blocks_x = o.blocks_x,
            .blocks_y = o.blocks_y,
            .blocks_z = o.blocks_z,
            .voxel = o.voxel,
            .truncation = o.truncation,
            .band = o.band,
            .max_depth = o.max_depth,
            .min_weight = o.min_weight};
}

void check_state(const TsdfState& s)
{
    const uint64_t voxels = uint64_t(s.blocks.rows) * kTsdfBlockVoxels;
    SR_ASSERT(s.state.rows == voxels * kTsdfStateFields && s.votes.rows == voxels * kTsdfVoteWords,
              "tsdf: state of {} and {} words for {} blocks", s.state.rows, s.votes.rows, s.blocks.rows);
}

} // namespace

Tensor tsdf_planes(Graph& g, const TsdfFrames& frames, const TsdfOptions& options)
{
    SR_ASSERT(frames.frames.ld == kTsdfFrameWords && frames.pixels.ld == 2, "tsdf_planes: frames of {} words",
              frames.frames.ld);
    const uint32_t rows = frames.pixels.rows;
    const Tensor planes = g.array(rows, DType::u32, "pixel planes", 4);
    g.dispatch(kernel::tsdf_planes, {{"Frames", frames.frames}, {"Pixels", frames.pixels}, {"Planes", planes}},
               make_push(options, rows, frames.frames.rows), threads(rows));
    return planes;
}

void tsdf_touch(Graph& g, Tensor frames, Tensor planes, const TsdfOptions& options, Tensor bitmap)
{
    SR_ASSERT(bitmap.rows >= options.bitmap_words(), "tsdf_touch: a bitmap of {} words for {} x {} x {} blocks",
              bitmap.rows, options.blocks_x, options.blocks_y, options.blocks_z);
    g.dispatch(kernel::tsdf_touch, {{"Frames", frames}, {"Planes", planes}, {"Bitmap", bitmap}},
               make_push(options, planes.rows, frames.rows), threads(planes.rows));
}

PrefixSum tsdf_rank(Graph& g, Tensor bitmap)
{
    const Tensor counts = g.array(bitmap.rows, DType::u32, "bits of words");
    g.dispatch(kernel::tsdf_count, {{"Bitmap", bitmap}, {"Counts", counts}}, make_push({}, bitmap.rows, 0),
               threads(bitmap.rows));
    return prefix_sum(g, counts);
}

void tsdf_list(Graph& g, Tensor bitmap, Tensor ranks, Tensor blocks)
{
    SR_ASSERT(ranks.rows == bitmap.rows, "tsdf_list: {} ranks for {} words", ranks.rows, bitmap.rows);
    g.dispatch(kernel::tsdf_list, {{"Bitmap", bitmap}, {"Ranks", ranks}, {"Blocks", blocks}},
               make_push({}, bitmap.rows, 0), threads(bitmap.rows));
}

void tsdf_integrate(Graph& g, Tensor frames, Tensor planes, const TsdfOptions& options, const TsdfState& state)
{
    check_state(state);
    const uint32_t voxels = state.blocks.rows * kTsdfBlockVoxels;
    DispatchOptions dispatch;
    dispatch.max_flops = 60.0 * voxels * frames.rows; // all voxels in front of the camera
    g.dispatch(kernel::tsdf_integrate,
               {{"Frames", frames},
                {"Planes", planes},
                {"Blocks", state.blocks},
                {"State", state.state},
                {"Votes", state.votes}},
               make_push(options, voxels, frames.rows), threads(voxels), std::move(dispatch));
}

void tsdf_finish(Graph& g, const TsdfState& state, const TsdfOptions& options, Tensor distances, Tensor attributes)
{
    check_state(state);
    const uint32_t voxels = state.blocks.rows * kTsdfBlockVoxels;
    SR_ASSERT(distances.rows == voxels && attributes.rows == voxels, "tsdf_finish: {} distances of {} voxels",
              distances.rows, voxels);
    g.dispatch(kernel::tsdf_finish,
               {{"State", state.state}, {"Votes", state.votes}, {"Distances", distances}, {"Attributes", attributes}},
               make_push(options, voxels, 0), threads(voxels));
}

} // namespace semrover
