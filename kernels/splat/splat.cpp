// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// 2D Gaussian splats to images (docs/method.md §5.3): keep what a camera can see, write records without
// gaps, sort them by depth (equal depths by camera and splat), make a pair for every tile that a record touches, sort
// those by tile, blend every pixel front to back:
//   alpha = min(alpha_max, o exp(-r^2 / 2)), w = alpha T, T' = T (1 - alpha)
// Cameras with a lens take other records and meet every splat with the ray of a pixel (docs/method.md §5.4).

#include "kernels/sort.h"
#include "splat_blend.spv.h"
#include "splat_count.spv.h"
#include "splat_cull.spv.h"
#include "splat_emit.spv.h"
#include "splat_lens_cull.spv.h"
#include "splat_lens_project.spv.h"
#include "splat_project.spv.h"
#include "splat_ray_blend.spv.h"
#include "splat_rays.spv.h"

#include <bit>

namespace semrover {

namespace {

constexpr const char* kMade[] = {"kColor", "kSurface", "kDepth", "kIds", "kOwners"}; // of SplatOptions::made

SplatPush make_push(const SplatTensors& scene, Tensor cameras, const SplatOptions& o)
{
    SplatPush push{};
    push.splats = scene.positions.rows;
    push.cameras = cameras.rows;
    push.width = o.width;
    push.height = o.height;
    push.tile = o.tile;
    push.tiles_x = divide_up(o.width, o.tile);
    push.tiles_y = divide_up(o.height, o.tile);
    push.max_visible = o.max_visible;
    push.max_pairs = o.max_pairs;
    push.near = o.near;
    push.alpha_min = o.alpha_min;
    push.alpha_max = o.alpha_max;
    push.transmittance_min = o.transmittance_min;
    push.cutoff2 = o.cutoff > 0 ? o.cutoff * o.cutoff : 1e30f;
    push.filter_scale = o.screen_variance > 0 ? 1 / o.screen_variance : 1e30f;
    push.movers = o.movers.rows / cameras.rows / (o.moving ? 2 : 1);
    push.mover_numbers = o.mover_rows.rows;
    return push;
}

void check(const SplatTensors& scene, Tensor cameras, const SplatOptions& o)
{
    const uint32_t n = scene.positions.rows;
    SR_ASSERT(scene.positions.ld == 4 && scene.normals.ld == 4 && scene.colors.ld == 4 && scene.normals.rows == n &&
                  scene.colors.rows == n && scene.labels.rows == n && scene.cells.rows == n && scene.owners.rows == n,
              "splat: scene of {} splats with arrays of other sizes", n);
    SR_ASSERT(!scene.blocks.valid() || scene.blocks.rows == divide_up(n, 64), "splat: {} blocks of {} splats",
              scene.blocks.rows, n);
    SR_ASSERT(cameras.ld == splat_camera_floats(o.lens) && o.width >= 1 && o.width <= 65535 && o.height >= 1 &&
                  o.height <= 65535,
              "splat: {} x {} pixels, cameras of {} floats", o.width, o.height, cameras.ld);
    SR_ASSERT(o.tile % 16 == 0 && o.tile > 0 && o.max_visible > 0 && o.max_pairs > 0,
              "splat: tiles of {}, {} splats, {} pairs", o.tile, o.max_visible, o.max_pairs);
    SR_ASSERT(!o.limits.valid() || (o.lens == SplatLens::pinhole && o.limits.ld == 1 &&
                                    o.limits.rows == o.width * o.height * cameras.rows),
              "splat: {} limits for {} x {} pixels", o.limits.rows, o.width, o.height);
    SR_ASSERT((o.lens == SplatLens::spinning) == o.rows.valid() &&
                  (!o.rows.valid() || (o.rows.rows == o.height && o.rows.ld == 4)),
              "splat: a table of {} rows for {}", o.rows.rows, o.height);
    SR_ASSERT(!o.moving || o.lens != SplatLens::pinhole, "splat: a pinhole that moves is an opencv lens");
    SR_ASSERT(
        o.movers.valid() == o.mover_rows.valid() &&
            (!o.movers.valid() || (o.movers.ld == 12 && o.movers.rows % (cameras.rows * (o.moving ? 2 : 1)) == 0)),
        "splat: {} views of movers for {} cameras", o.movers.rows, cameras.rows);
    SR_ASSERT(uint64_t(n) * cameras.rows < 1ull << 32, "splat: {} splats in {} cameras", n, cameras.rows);
}

std::vector<NamedTensor> with(std::vector<NamedTensor> tensors, std::initializer_list<NamedTensor> more)
{
    tensors.insert(tensors.end(), more);
    return tensors;
}

// what cameras can see
struct Seen {
    Tensor records, sources, depths, count;
};

Seen project(Graph& g, const SplatTensors& scene, Tensor cameras, const SplatOptions& o, const SplatPush& push)
{
    const bool pinhole = o.lens == SplatLens::pinhole;
    const uint32_t views = push.splats * push.cameras;
    DispatchOptions lens;
    lens.constants = {{"kMovers", o.movers.valid()}};
    if (!pinhole)
        lens.constants.insert(lens.constants.end(), {{"kModel", uint32_t(o.lens)}, {"kMoving", o.moving}});
    const Tensor keep = g.array(views, DType::u32, "keep");
    DispatchOptions cull = lens;
    cull.constants.push_back({"kBlocks", scene.blocks.valid()});
    std::vector<NamedTensor> read{
        {"Cameras", cameras},     {"Positions", scene.positions}, {"Normals", scene.normals},  {"Colors", scene.colors},
        {"Owners", scene.owners}, {"Movers", o.movers},           {"MoverRows", o.mover_rows}, {"Keep", keep}};
    if (!pinhole)
        read.push_back({"Rows", o.rows});
    g.dispatch(pinhole ? kernel::splat_cull : kernel::splat_lens_cull, with(read, {{"Blocks", scene.blocks}}), push,
               threads(views), std::move(cull));
    const PrefixSum slots = prefix_sum(g, keep, {.non_zero = true});
    const uint32_t texels = splat_record_bytes(o.lens, o.moving) / 16;
    const Tensor records = g.array(push.max_visible * texels, DType::u32, "splat records", 4);
    const Tensor sources = g.array(push.max_visible, DType::u32, "splat sources");
    const Tensor depths = g.array(push.max_visible, DType::u32, "splat depths");
    g.dispatch(pinhole ? kernel::splat_project : kernel::splat_lens_project,
               with(read, {{"Slots", slots.sums}, {"Records", records}, {"Sources", sources}, {"Depths", depths}}),
               push, threads(views), lens);
    return {records, sources, depths, slots.total};
}

// records by tile, nearest first, and the first pair of each tile
struct Tiled {
    Tensor records, starts, pairs;
};

Tiled sort_into_tiles(Graph& g, const Seen& seen, const SplatOptions& o, const SplatPush& push)
{
    const uint32_t tiles_all = push.tiles_x * push.tiles_y * push.cameras;
    DispatchOptions lens;
    lens.constants = {{"kTexels", splat_record_bytes(o.lens, o.moving) / 16}};
    const Tensor order = radix_sort(g, seen.depths, {}, {.count = seen.count}).values;
    const Tensor touched = g.array(push.max_visible, DType::u32, "tiles touched");
    g.dispatch(kernel::splat_count,
               {{"Records", seen.records}, {"Order", order}, {"Count", seen.count}, {"Tiles", touched}}, push,
               threads(push.max_visible), lens);
    const PrefixSum first = prefix_sum(g, touched, {.count = seen.count});
    const SortedPairs pairs = {g.array(push.max_pairs, DType::u32, "pair tiles"),
                               g.array(push.max_pairs, DType::u32, "pair records")};
    DispatchOptions emit = lens;
    emit.max_flops = 60.0 * push.max_pairs;
    g.dispatch(kernel::splat_emit,
               {{"Records", seen.records},
                {"Sources", seen.sources},
                {"Order", order},
                {"Count", seen.count},
                {"First", first.sums},
                {"PairTiles", pairs.keys},
                {"PairRecords", pairs.values}},
               push, threads(push.max_visible), std::move(emit));
    const uint32_t bits = std::max(1, int(std::bit_width(tiles_all - 1)));
    const SortedPairs by_tile = radix_sort(g, pairs.keys, pairs.values, {.bits = bits, .count = first.total});
    return {by_tile.values, bucket_starts(g, by_tile.keys, tiles_all, first.total), first.total};
}

} // namespace

SplatImages splat(Graph& g, const SplatTensors& scene, Tensor cameras, const SplatOptions& options)
{
    check(scene, cameras, options);
    const SplatPush push = make_push(scene, cameras, options);
    const uint32_t pixels = options.width * options.height * push.cameras;
    const Seen seen = project(g, scene, cameras, options, push);
    const Tiled by_tile = sort_into_tiles(g, seen, options, push);
    const auto rows = [&](size_t picture) { return options.made[picture] ? pixels : 1; };
    const SplatImages y = {g.array(rows(0), DType::f32, "splat colour", 4),
                           g.array(rows(1), DType::f32, "splat surface", 4),
                           g.array(rows(2), DType::f32, "splat depth", 2),
                           g.array(rows(3), DType::u32, "splat ids", 2),
                           g.array(rows(4), DType::u32, "splat owners"),
                           seen.count,
                           by_tile.pairs};
    DispatchOptions blend;
    blend.max_flops = 40.0 * push.max_pairs * options.tile * options.tile; // no pixel is done early
    for (size_t picture = 0; picture < options.made.size(); ++picture)
        blend.constants.push_back({kMade[picture], options.made[picture]});
    const auto grid = [&](const Kernel& kernel) {
        const KernelVariant& v = g.variant(kernel);
        return tiles(options.height, options.width, push.cameras, {v.value("kTileM"), v.value("kTileN")});
    };
    const std::vector<NamedTensor> tensors{{"Records", seen.records},  {"Pairs", by_tile.records},
                                           {"Starts", by_tile.starts}, {"Sources", seen.sources},
                                           {"Labels", scene.labels},   {"Cells", scene.cells},
                                           {"Color", y.color},         {"Surface", y.surface},
                                           {"Depth", y.depth},         {"Ids", y.ids},
                                           {"Owners", scene.owners},   {"Owner", y.owners}};
    if (options.lens == SplatLens::pinhole) {
        const bool limited = options.limits.valid();
        blend.constants.push_back({"kLimited", limited});
        g.dispatch(kernel::splat_blend, with(tensors, {{"Limits", options.limits}}), push, grid(kernel::splat_blend),
                   std::move(blend));
        return y;
    }
    const ConstantValue model{"kModel", uint32_t(options.lens)};
    blend.constants.push_back(model);
    blend.constants.push_back({"kMedianIds", options.lens == SplatLens::spinning});
    blend.constants.push_back({"kTexels", splat_record_bytes(options.lens, options.moving) / 16});
    const Tensor rays = g.array(options.moving ? 2 * pixels : pixels, DType::f32, "rays", 4);
    g.dispatch(kernel::splat_rays, {{"Cameras", cameras}, {"Rays", rays}, {"Rows", options.rows}}, push,
               threads(pixels), {.constants = {model, {"kMoving", options.moving}}});
    g.dispatch(kernel::splat_ray_blend, with(tensors, {{"Rays", rays}}), push, grid(kernel::splat_ray_blend),
               std::move(blend));
    return y;
}

} // namespace semrover
