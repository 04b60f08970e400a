// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/fusion/tsdf_volume.h"

#include "runtime/device/executable.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace semrover {

namespace {

constexpr double kMaxExtent = 1e4, kMaxCoordinate = 1e6; // metres
constexpr uint64_t kBlockBytes = uint64_t(kTsdfBlockVoxels) * 4;
constexpr uint64_t kChunkBytes = 1ull << 30; // of votes and sums, where nothing else limits them

// the box around what a camera can see, metres
std::pair<Point3, Point3> view_bounds(const CameraFrame& frame, double depth)
{
    const Intrinsics& k = frame.intrinsics;
    const Rigid camera_to_world = frame.pose.camera_to_world();
    Point3 low = translation_of(camera_to_world), high = low;
    for (const double u : {0.0, double(k.width)})
        for (const double v : {0.0, double(k.height)}) {
            const Point3 corner = {(u - k.cx) / k.fx * depth, (v - k.cy) / k.fy * depth, depth};
            const Point3 p = transform(camera_to_world, corner);
            for (size_t axis = 0; axis < 3; ++axis) {
                low[axis] = std::min(low[axis], p[axis]);
                high[axis] = std::max(high[axis], p[axis]);
            }
        }
    return {low, high};
}

Status check_positions(const DepthFrames& frames)
{
    const Point3 origin = translation_of(frames.cameras.front().pose.camera_to_world());
    for (size_t i = 0; i < frames.cameras.size(); ++i) {
        const Point3 p = translation_of(frames.cameras[i].pose.camera_to_world());
        for (size_t axis = 0; axis < 3; ++axis) {
            if (!(std::abs(p[axis]) <= kMaxCoordinate))
                return fail(ErrorCode::bad_input,
                            "frame {} is at ({:.6g}, {:.6g}, {:.6g}) m, expected coordinates within {:.0f} m", i, p[0],
                            p[1], p[2], kMaxCoordinate);
            if (std::abs(p[axis] - origin[axis]) > kMaxExtent)
                return fail(ErrorCode::bad_input,
                            "frame {} is {:.0f} m from frame 0 along {}, expected a scene of at most {:.0f} m; fuse "
                            "its parts one by one",
                            i, std::abs(p[axis] - origin[axis]), "xyz"[axis], kMaxExtent);
        }
    }
    return {};
}

Status report(const FusionProgress& progress, const char* stage, size_t done, size_t total)
{
    return progress ? progress(stage, done, total) : Status{};
}

} // namespace

Result<TsdfVolume> TsdfVolume::create(Device& device, const DepthFrames& frames, const FusionOptions& options,
                                      const FusionProgress& progress)
{
    SR_ASSERT(!frames.cameras.empty(), "no frames to fuse");
    TsdfVolume volume(device, options);
    SR_CHECK(check_positions(frames));
    SR_CHECK(volume.plan_box(frames));
    SR_TRY(FrameBatch batch, FrameBatch::create(device, frames));
    SR_CHECK(volume.touch(frames, batch, progress));
    SR_CHECK(volume.list_blocks());
    SR_CHECK(volume.integrate(frames, batch, progress));
    return volume;
}

TsdfOptions TsdfVolume::kernel_options() const
{
    TsdfOptions o{.blocks_x = box_.blocks[0], .blocks_y = box_.blocks[1], .blocks_z = box_.blocks[2]};
    o.voxel = float(options_.voxel);
    o.truncation = float(options_.voxel * options_.truncation);
    o.band = o.truncation / 2;
    o.max_depth = float(options_.max_depth);
    o.min_weight = float(options_.min_weight);
    return o;
}

Status TsdfVolume::plan_box(const DepthFrames& frames)
{
    const double block = options_.voxel * 8, truncation = options_.voxel * options_.truncation;
    std::array<int64_t, 3> low, high;
    low.fill(INT64_MAX);
    high.fill(INT64_MIN);
    for (const CameraFrame& frame : frames.cameras) {
        const auto [from, to] = view_bounds(frame, options_.max_depth + truncation);
        Reach& reach = reach_.emplace_back();
        for (size_t axis = 0; axis < 3; ++axis) {
            reach.low[axis] = int64_t(std::floor((from[axis] - truncation) / block));
            reach.high[axis] = int64_t(std::floor((to[axis] + truncation) / block)) + 1;
            low[axis] = std::min(low[axis], reach.low[axis]);
            high[axis] = std::max(high[axis], reach.high[axis]);
        }
    }
    box_.voxel = options_.voxel;
    double all = 1;
    for (size_t axis = 0; axis < 3; ++axis) {
        all *= double(high[axis] - low[axis]);
        box_.low[axis] = low[axis] * 8;
        box_.blocks[axis] = uint32_t(std::min<int64_t>(high[axis] - low[axis], UINT32_MAX));
        for (Reach& reach : reach_) {
            reach.low[axis] -= low[axis];
            reach.high[axis] -= low[axis];
        }
    }
    const double most =
        std::min(double(std::min(device_->limits().max_storage_range, device_->limits().max_allocation)) * 8 - 256,
                 4294967040.0);
    if (all > most)
        return fail(ErrorCode::bad_input,
                    "the cameras see {:.0f} x {:.0f} x {:.0f} m, {:.3g} blocks of {:.3g} m; this device keeps track of "
                    "{:.3g}: fuse parts of the path, or use a larger `voxel` or a smaller `max_depth`",
                    box_.blocks[0] * block, box_.blocks[1] * block, box_.blocks[2] * block, all, block, most);
    return {};
}

Status TsdfVolume::touch(const DepthFrames& frames, FrameBatch& batch, const FusionProgress& progress)
{
    const TsdfOptions options = kernel_options();
    bitmap_ = box_state_.tensor(options.bitmap_words(), 1, DType::u32, "bitmap", 1);
    ranks_ = box_state_.tensor(options.bitmap_words(), 1, DType::u32, "ranks", 1);
    total_ = box_state_.tensor(1, 1, DType::u32, "blocks", 1);
    SR_CHECK(box_state_.allocate(*device_, "blocks of the box"));
    SR_CHECK(bitmap_.clear(*device_));
    Graph g(device_->limits());
    const TsdfFrames table = batch.in(g);
    tsdf_touch(g, table.frames, tsdf_planes(g, table, options), options, bitmap_.in(g));
    SR_TRY(const auto executable, Executable::create(*device_, g));
    std::vector<uint32_t> order(frames.cameras.size());
    std::iota(order.begin(), order.end(), 0u);
    for (size_t next = 0; next < order.size();) {
        const size_t count = batch.fitting(frames, order, next);
        SR_CHECK(batch.upload(frames, box_, std::span(order).subspan(next, count), options_.excluded));
        SR_CHECK(executable->run());
        next += count;
        SR_CHECK(report(progress, "find surface", next, order.size()));
    }
    return {};
}

Status TsdfVolume::list_blocks()
{
    Graph count(device_->limits());
    const PrefixSum ranked = tsdf_rank(count, bitmap_.in(count));
    count.keep(ranked.sums, ranks_);
    count.keep(ranked.total, total_);
    SR_TRY(auto executable, Executable::create(*device_, count));
    SR_CHECK(executable->run());
    SR_TRY(const std::vector<uint32_t> total, total_.read<uint32_t>(*device_));
    const uint32_t blocks = total.front();
    if (blocks == 0)
        return fail(ErrorCode::bad_input,
                    "nothing was observed: no pixel of {} frames has a depth within {} m; `max_depth` goes further (by "
                    "default, to where a pixel is 0.55 voxels wide, so a larger `voxel` does, too); or is "
                    "`depth.unit` another?",
                    reach_.size(), options_.max_depth);
    const uint64_t most = std::min(device_->limits().max_storage_range, device_->limits().max_allocation) / kBlockBytes;
    if (blocks > most)
        return fail(ErrorCode::out_of_memory,
                    "the surface fills {} blocks of 8^3 voxels; this device has room for {}: fuse parts of the path, "
                    "or use a larger `voxel` or a smaller `max_depth`",
                    blocks, most);
    block_ids_ = field_.tensor(blocks, 1, DType::u32, "blocks", 1);
    distances_ = field_.tensor(blocks * kTsdfBlockVoxels, 1, DType::f32, "distances", 1);
    attributes_ = field_.tensor(blocks * kTsdfBlockVoxels, 1, DType::u32, "attributes", 1);
    SR_CHECK(field_.allocate(*device_, "distance field"));
    Graph g(device_->limits());
    tsdf_list(g, bitmap_.in(g), ranks_.in(g), block_ids_.in(g));
    SR_TRY(executable, Executable::create(*device_, g));
    SR_CHECK(executable->run());
    SR_TRY(blocks_, block_ids_.read<uint32_t>(*device_));
    return {};
}

// how many blocks' sums and votes fit at a time
Result<uint32_t> TsdfVolume::chunk_blocks(const FrameBatch& batch) const
{
    const DeviceLimits& limits = device_->limits();
    const uint64_t each = kBlockBytes * (kTsdfStateFields + kTsdfVoteWords);
    const uint64_t bindable =
        std::min(limits.max_storage_range, limits.max_allocation) / (kBlockBytes * kTsdfVoteWords);
    uint64_t most = std::min(bindable, kChunkBytes / each);
    if (options_.max_chunk_blocks)
        most = std::min<uint64_t>(most, options_.max_chunk_blocks);
    if (device_->budget()) {
        const uint64_t used = device_->allocated_bytes() + uint64_t(batch.pixels()) * 16 + (1u << 20); // and planes
        const uint64_t left = device_->budget() > used ? device_->budget() - used : 0;
        if (left < each)
            return fail(ErrorCode::out_of_memory,
                        "`max_bytes`: {} bytes are needed besides votes and {} bytes for every block of them, {} are "
                        "allowed",
                        used, each, device_->budget());
        most = std::min(most, left / each);
    }
    return uint32_t(std::min<uint64_t>(most, blocks_.size()));
}

struct TsdfVolume::ChunkState {
    TensorPool memory;
    DeviceTensor blocks, sums, votes;

    explicit ChunkState(uint32_t most)
        : blocks(memory.tensor(most, 1, DType::u32, "blocks", 1)),
          sums(memory.tensor(most * kTsdfBlockVoxels * kTsdfStateFields, 1, DType::f32, "sums", 1)),
          votes(memory.tensor(most * kTsdfBlockVoxels * kTsdfVoteWords, 1, DType::u32, "votes", 1))
    {
    }
    // of the first `count` blocks
    TsdfState in(Graph& g, uint32_t count) const
    {
        const uint32_t voxels = count * kTsdfBlockVoxels;
        return {blocks.row_range(0, count).in(g), sums.row_range(0, voxels * kTsdfStateFields).in(g),
                votes.row_range(0, voxels * kTsdfVoteWords).in(g)};
    }
};

Status TsdfVolume::integrate(const DepthFrames& frames, FrameBatch& batch, const FusionProgress& progress)
{
    SR_TRY(const uint32_t most, chunk_blocks(batch));
    const uint32_t blocks = uint32_t(blocks_.size());
    chunks_ = divide_up(blocks, most);
    ChunkState state(most);
    SR_CHECK(state.memory.allocate(*device_, "votes"));
    for (uint32_t chunk = 0; chunk < chunks_; ++chunk) {
        const uint32_t first = chunk * most, count = std::min(most, blocks - first);
        const auto added = [&](size_t frame) {
            return report(progress, "fuse", chunk * frames.cameras.size() + frame, chunks_ * frames.cameras.size());
        };
        SR_CHECK(integrate_chunk(frames, batch, state, first, count, added));
    }
    return {};
}

Status TsdfVolume::integrate_chunk(const DepthFrames& frames, FrameBatch& batch, const ChunkState& state,
                                   uint32_t first, uint32_t count, const std::function<Status(size_t)>& added)
{
    const TsdfOptions options = kernel_options();
    const uint32_t at = first * kTsdfBlockVoxels, voxels = count * kTsdfBlockVoxels;
    Graph g(device_->limits());
    const TsdfFrames table = batch.in(g);
    tsdf_integrate(g, table.frames, tsdf_planes(g, table, options), options, state.in(g, count));
    SR_TRY(auto executable, Executable::create(*device_, g));
    SR_CHECK(state.sums.clear(*device_));
    SR_CHECK(state.votes.clear(*device_));
    SR_CHECK(state.blocks.row_range(0, count).write(*device_, std::span(blocks_).subspan(first, count)));
    const std::vector<uint32_t> order = frames_near(first, count);
    for (size_t next = 0; next < order.size();) {
        const size_t fitting = batch.fitting(frames, order, next);
        SR_CHECK(batch.upload(frames, box_, std::span(order).subspan(next, fitting), options_.excluded));
        SR_CHECK(executable->run());
        next += fitting;
        SR_CHECK(added(order[next - 1] + 1));
    }
    Graph finish(device_->limits());
    tsdf_finish(finish, state.in(finish, count), options, distances_.row_range(at, voxels).in(finish),
                attributes_.row_range(at, voxels).in(finish));
    SR_TRY(executable, Executable::create(*device_, finish));
    return executable->run();
}

// frames that may see one of these blocks, in order
std::vector<uint32_t> TsdfVolume::frames_near(uint32_t first, uint32_t count) const
{
    std::array<int64_t, 3> low, high;
    low.fill(INT64_MAX);
    high.fill(INT64_MIN);
    for (uint32_t i = first; i < first + count; ++i) {
        const uint32_t id = blocks_[i], x = box_.blocks[0], y = box_.blocks[1];
        const std::array<int64_t, 3> block = {id % x, id / x % y, id / (x * y)};
        for (size_t axis = 0; axis < 3; ++axis) {
            low[axis] = std::min(low[axis], block[axis]);
            high[axis] = std::max(high[axis], block[axis] + 1);
        }
    }
    std::vector<uint32_t> near;
    for (uint32_t i = 0; i < reach_.size(); ++i) {
        bool meets = true;
        for (size_t axis = 0; axis < 3; ++axis)
            meets = meets && reach_[i].low[axis] < high[axis] && low[axis] < reach_[i].high[axis];
        if (meets)
            near.push_back(i);
    }
    return near;
}

MarchingCubesField TsdfVolume::in(Graph& g) const
{
    return {.blocks_x = box_.blocks[0],
            .blocks_y = box_.blocks[1],
            .blocks_z = box_.blocks[2],
            .bitmap = bitmap_.in(g),
            .ranks = ranks_.in(g),
            .blocks = block_ids_.in(g),
            .distances = distances_.in(g),
            .attributes = attributes_.in(g),
            .min_views = options_.min_views,
            .max_jump = float(options_.max_jump / options_.truncation)};
}

} // namespace semrover
