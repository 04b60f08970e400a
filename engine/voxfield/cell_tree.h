// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace semrover {

// k-d tree over integer cells, with exact order: nearer first, then lower cell index. Each cell is free, set aside or
// covered; the tree counts free voxels per node so that searches for them skip the rest.
//
// A (squared distance, cell index) pair is packed into one 64-bit key, distance << index_bits | index, so that
// comparing keys is comparing pairs.
class CellTree {
  public:
    enum class State : uint8_t { free, set_aside, covered };
    static constexpr uint64_t kNoKey = UINT64_MAX;

    // bad input: no voxels, two equal voxels, or more voxels over a wider extent than one key can hold
    // (1 M voxels may span 2^20 voxels along every axis)
    static Result<CellTree> build(std::span<const std::array<int32_t, 3>> cells);

    uint32_t size() const { return uint32_t(points_.size()); }
    uint32_t leaf_count() const { return uint32_t(leaves_.size()); }
    uint32_t index_of(uint64_t key) const { return uint32_t(key & ((uint64_t(1) << index_bits_) - 1)); }
    uint32_t leaf_of(uint32_t cell) const { return leaf_of_slot_[slot_of_[cell]]; }

    State state(uint32_t cell) const { return states_[slot_of_[cell]]; }
    void set_state(uint32_t cell, State state);
    uint32_t free_count() const { return nodes_[0].free; }

    // keys of the min(count, size()) voxels nearest to `cell`, itself included, in no particular order
    void nearest(uint32_t cell, uint32_t count, std::vector<uint64_t>& keys) const;

    // smallest key (squared distance from the nearest covered voxel of `leaf`, free voxel) over all free voxels;
    // kNoKey if there is no free voxel, or the leaf has no covered one
    uint64_t nearest_free(uint32_t leaf) const;

  private:
    struct Point {
        int64_t x, y, z; // relative to the cloud's lowest corner
        uint32_t cell;
    };
    struct Box {
        std::array<int64_t, 3> low, high; // inclusive
    };
    struct Node {
        Box box;
        uint32_t begin, end; // slots
        uint32_t parent;
        uint32_t right; // left child is the next node; 0 in a leaf
        uint32_t free;
    };

    CellTree() = default;
    Status measure(std::span<const std::array<int32_t, 3>> cells);
    uint32_t build_node(uint32_t begin, uint32_t end, uint32_t parent);
    Box box_of(uint32_t begin, uint32_t end) const;
    uint64_t key(int64_t distance, uint32_t cell) const { return uint64_t(distance) << index_bits_ | cell; }
    void scan_free(const Node& node, const Box& box, std::span<const uint32_t> sources, uint64_t& best) const;
    static int64_t distance(const Point& a, const Point& b);
    static int64_t distance(const Point& a, const Box& b);
    static int64_t distance(const Box& a, const Box& b);

    std::vector<Point> points_; // in tree order; a position here is a slot
    std::vector<State> states_; // by slot
    std::vector<uint32_t> slot_of_;
    std::vector<uint32_t> leaf_of_slot_;
    std::vector<uint32_t> leaves_; // node of each leaf
    std::vector<Node> nodes_;      // preorder
    std::array<int64_t, 3> origin_ = {};
    int index_bits_ = 1;
};

} // namespace semrover
