// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/voxfield/regions.h"

#include "engine/voxfield/cell_tree.h"

#include <algorithm>
#include <queue>

namespace semrover {

namespace {

using CellState = CellTree::State;

constexpr int kMaxRegionSize = 4096; // the paper's sets hold 50 to 150; attention over a set is quadratic

// The next seed is the smallest (distance to a covered voxel, index) over the free voxels. Each leaf of the tree keeps
// in a queue the smallest such key seen from its own covered voxels. Between two coverings free voxels only disappear,
// so a leaf's true key only grows and the queued one stays a lower bound: it is computed again only when it reaches the
// front and the voxel it names is gone. A leaf that gains a covered voxel is queued again with key 0.
class Frontier {
  public:
    explicit Frontier(const CellTree& tree) : tree_(tree), keys_(tree.leaf_count(), CellTree::kNoKey) {}

    void touch(uint32_t leaf)
    {
        if (keys_[leaf] != 0)
            push(0, leaf);
    }

    // the free voxel nearest to the covered ones; there must be a free and a covered voxel
    uint32_t seed()
    {
        while (true) {
            const auto [key, leaf] = queue_.top();
            const bool current = key == keys_[leaf];
            if (current && key != 0 && tree_.state(tree_.index_of(key)) == CellState::free)
                return tree_.index_of(key);
            queue_.pop();
            if (current)
                push(tree_.nearest_free(leaf), leaf);
        }
    }

  private:
    void push(uint64_t key, uint32_t leaf)
    {
        keys_[leaf] = key;
        queue_.push({key, leaf});
    }

    using Entry = std::pair<uint64_t, uint32_t>; // key, leaf
    const CellTree& tree_;
    std::vector<uint64_t> keys_; // of each leaf's latest entry; older ones are skipped
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue_;
};

class Cover {
  public:
    Cover(CellTree& tree, std::span<const std::array<int32_t, 3>> cells, const RegionOptions& options)
        : tree_(tree), cells_(cells), frontier_(tree), options_(options),
          threshold_(std::min(options.coverage_threshold, most_targets(options)))
    {
        regions_.offsets.push_back(0);
    }

    void cover(std::span<const uint8_t> known)
    {
        for (uint32_t cell = 0; cell < known.size(); ++cell)
            if (known[cell])
                cover(cell);
    }

    Regions run()
    {
        if (tree_.free_count() == tree_.size())
            accept(uint32_t(options_.first_cell));
        std::vector<uint32_t> set_aside;
        while (tree_.free_count() > 0) {
            const uint32_t seed = frontier_.seed();
            if (try_accept(seed))
                continue;
            if (options_.strategy == RegionStrategy::paper)
                break;
            tree_.set_state(seed, CellState::set_aside);
            set_aside.push_back(seed);
        }
        if (options_.strategy != RegionStrategy::paper)
            take_rest(set_aside);
        for (uint32_t cell = 0; cell < tree_.size(); ++cell)
            if (tree_.state(cell) != CellState::covered)
                regions_.uncovered.push_back(cell);
        return std::move(regions_);
    }

  private:
    bool try_accept(uint32_t seed)
    {
        tree_.nearest(seed, uint32_t(cells_considered(options_)), keys_);
        const auto fresh = std::count_if(keys_.begin(), keys_.end(), [&](uint64_t key) { return !is_covered(key); });
        if (fresh < threshold_)
            return false;
        add(seed);
        return true;
    }

    void accept(uint32_t seed)
    {
        tree_.nearest(seed, uint32_t(cells_considered(options_)), keys_);
        add(seed);
    }

    bool is_covered(uint64_t key) const { return tree_.state(tree_.index_of(key)) == CellState::covered; }

    // the region among keys_
    void add(uint32_t seed)
    {
        std::sort(keys_.begin(), keys_.end());
        if (options_.strategy == RegionStrategy::rim)
            choose();
        for (uint64_t key : keys_) {
            const uint32_t cell = tree_.index_of(key);
            regions_.members.push_back(cell);
            if (!is_covered(key))
                cover(cell);
        }
        regions_.offsets.push_back(uint32_t(regions_.members.size()));
        regions_.seeds.push_back(seed);
    }

    // leaves targets and their rim in keys_, which stay nearest to the seed first
    void choose()
    {
        std::vector<uint64_t> chosen, covered;
        for (const uint64_t key : keys_)
            (is_covered(key) ? covered : chosen).push_back(key);
        chosen.resize(std::min(chosen.size(), size_t(most_targets(options_))));
        std::vector<std::pair<int64_t, uint64_t>> rim; // squared distance from the nearest target, key
        for (const uint64_t key : covered) {
            int64_t nearest = INT64_MAX;
            for (const uint64_t target : chosen)
                nearest = std::min(nearest, distance(tree_.index_of(key), tree_.index_of(target)));
            rim.emplace_back(nearest, key);
        }
        std::sort(rim.begin(), rim.end());
        rim.resize(std::min(rim.size(), size_t(rim_cells(options_, int(chosen.size())))));
        for (const auto& [nearest, key] : rim)
            chosen.push_back(key);
        keys_ = std::move(chosen);
        std::sort(keys_.begin(), keys_.end());
    }

    int64_t distance(uint32_t a, uint32_t b) const // squared
    {
        int64_t sum = 0;
        for (size_t axis = 0; axis < 3; ++axis) {
            const int64_t d = int64_t(cells_[a][axis]) - cells_[b][axis];
            sum += d * d;
        }
        return sum;
    }

    void cover(uint32_t cell)
    {
        tree_.set_state(cell, CellState::covered);
        frontier_.touch(tree_.leaf_of(cell));
    }

    // seeds that were set aside and are still uncovered come back, so every leaf has to look again
    void take_rest(std::span<const uint32_t> set_aside)
    {
        for (uint32_t cell : set_aside)
            if (tree_.state(cell) == CellState::set_aside)
                tree_.set_state(cell, CellState::free);
        for (uint32_t leaf = 0; leaf < tree_.leaf_count(); ++leaf)
            frontier_.touch(leaf);
        while (tree_.free_count() > 0)
            accept(frontier_.seed());
    }

    CellTree& tree_;
    std::span<const std::array<int32_t, 3>> cells_;
    Frontier frontier_;
    const RegionOptions options_;
    int threshold_;
    Regions regions_;
    std::vector<uint64_t> keys_; // of the region being looked at
};

} // namespace

std::string_view region_strategy_name(RegionStrategy strategy)
{
    return std::array<std::string_view, 3>{"paper", "complete", "rim"}[size_t(strategy)];
}

// more than the region, so that a seed at the edge of what is covered finds as many uncovered voxels as it may have
int cells_considered(const RegionOptions& o)
{
    return o.strategy == RegionStrategy::rim ? o.region_size * 5 / 2 : o.region_size;
}

int most_targets(const RegionOptions& o)
{
    return o.strategy == RegionStrategy::rim ? o.region_size - o.region_size * 3 / 16 : o.region_size;
}

// small regions have a wider rim: half the region in all
int rim_cells(const RegionOptions& o, int targets)
{
    return std::max(o.region_size - most_targets(o), o.region_size / 2 - targets);
}

Result<Regions> extract_regions(std::span<const std::array<int32_t, 3>> cells, const RegionOptions& options,
                                std::span<const uint8_t> known)
{
    if (options.region_size < 1 || options.region_size > kMaxRegionSize)
        return fail(ErrorCode::bad_input, "region_size is {}, expected 1 to {}", options.region_size, kMaxRegionSize);
    if (options.coverage_threshold < 1 || options.coverage_threshold > options.region_size)
        return fail(ErrorCode::bad_input, "coverage_threshold is {}, expected 1 to region_size, {}",
                    options.coverage_threshold, options.region_size);
    if (cells.size() > UINT32_MAX / uint32_t(options.region_size))
        return fail(ErrorCode::bad_input, "{} voxels in regions of {} need more than 32-bit offsets: split the scene",
                    cells.size(), options.region_size);
    SR_TRY(CellTree tree, CellTree::build(cells));
    if (options.first_cell < 0 || options.first_cell >= int64_t(cells.size()))
        return fail(ErrorCode::bad_input, "first_cell is {}, but the grid has {} voxels", options.first_cell,
                    cells.size());
    SR_ASSERT((!options.from_known && known.empty()) || known.size() == cells.size(), "{} flags for {} voxels",
              known.size(), cells.size());
    Cover cover(tree, cells, options);
    if (options.from_known || options.strategy == RegionStrategy::rim)
        cover.cover(known);
    return cover.run();
}

} // namespace semrover
