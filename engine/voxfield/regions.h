// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace semrover {

// Which voxels make a region, and what to do with a seed whose region has too few uncovered ones.
enum class RegionStrategy {
    paper,    // the nearest voxels; stop at such a seed, as Algorithm 1 is printed: most of a scene may stay uncovered
    complete, // the nearest voxels; set such a seed aside, and when no other is left, take the remaining voxels nearest
              // first, with their whole region
    rim,      // as complete, but mostly uncovered voxels and a rim of covered ones: see most_targets and rim_cells
};
std::string_view region_strategy_name(RegionStrategy strategy);

struct RegionOptions {
    int region_size = 128;       // K, 1..4096: voxels in a region; fewer with strategy rim, or if the cloud has fewer
    int coverage_threshold = 32; // T, 1..K: a region with fewer uncovered voxels is not accepted
    RegionStrategy strategy = RegionStrategy::complete;
    int64_t first_cell = 0; // index of the voxel the first region grows around
    // voxels that have points already count as covered: regions grow from them into what is missing, and none is made
    // where nothing is. extract_regions needs the cells' flags for it.
    bool from_known = false;
    // Above 0: in the order of tiles (tile_regions.h), square ones of so many voxels; known voxels up to halo_cells
    // away from a tile are seen by its regions. first_cell and from_known have no meaning then.
    int32_t tile_cells = 0, halo_cells = 0;
};

// A region of strategy rim is chosen among the cells_considered(o) voxels nearest to its seed. It has their uncovered
// ones, nearest first, up to most_targets(o); and of their covered ones the rim_cells(o, targets) that are nearest to
// one of these (ties: nearer to the seed). With the other strategies it has all voxels that are considered.
int cells_considered(const RegionOptions& options);
int most_targets(const RegionOptions& options);
int rim_cells(const RegionOptions& options, int targets);

// regions in the order they were found; region r is members[offsets[r]] .. members[offsets[r + 1] - 1]
struct Regions {
    std::vector<uint32_t> offsets;   // [regions + 1]
    std::vector<uint32_t> members;   // cell indices, per region nearest to its seed first, then lower index
    std::vector<uint32_t> seeds;     // [regions] cell indices
    std::vector<uint32_t> uncovered; // voxels in no region, ascending; empty unless strategy is paper

    size_t size() const { return seeds.size(); }
    std::span<const uint32_t> region(size_t r) const
    {
        return {members.data() + offsets[r], members.data() + offsets[r + 1]};
    }
};

// Algorithm 1 of SEM-ROVER's supplement, or a strategy of ours: covers a cloud of voxels with overlapping regions.
// cells [n]: distinct integer indices (i, j, k). Each new seed is the uncovered voxel nearest to the regions so far;
// distances are exact squared integers, and ties go to the lower index. Near-linear: 1 M voxels of a street take about
// 1 s on one core of a 2-core Xeon, the slowest cloud tried (a solid lattice with T = K) 13 s.
// Bad input: no voxels, equal voxels, options out of range, more than 2^32 / K voxels, a cloud too wide for 64-bit
// keys. known [n], read with options.from_known and with strategy rim: voxels with a value other than 0 are covered
// from the start, and the first seed is the voxel nearest to them; without any, first_cell.
Result<Regions> extract_regions(std::span<const std::array<int32_t, 3>> cells, const RegionOptions& options,
                                std::span<const uint8_t> known = {});

} // namespace semrover
