// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/bvh.h"

#include "runtime/base/result.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>

namespace semrover {

namespace {

constexpr int kBins = 16;
constexpr uint32_t kHalvingDepth = 20; // from here on by number: 2^28 triangles are 26 levels more
constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct Box {
    std::array<float, 3> low{kInfinity, kInfinity, kInfinity}, high{-kInfinity, -kInfinity, -kInfinity};

    void grow(const std::array<float, 3>& p)
    {
        for (size_t a = 0; a < 3; ++a) {
            low[a] = std::min(low[a], p[a]);
            high[a] = std::max(high[a], p[a]);
        }
    }
    void grow(const Box& b)
    {
        grow(b.low);
        grow(b.high);
    }
    double area() const
    {
        if (!(low[0] <= high[0]))
            return 0;
        const double x = double(high[0]) - low[0], y = double(high[1]) - low[1], z = double(high[2]) - low[2];
        return x * y + y * z + z * x;
    }
};

struct Item {
    Box box;
    std::array<float, 3> center;
    uint32_t triangle;
};

class Builder {
  public:
    Builder(std::span<const std::array<float, 3>> positions, std::span<const std::array<uint32_t, 3>> faces)
    {
        items_.resize(faces.size());
        for (size_t f = 0; f < faces.size(); ++f) {
            Item& item = items_[f];
            item.triangle = uint32_t(f);
            for (uint32_t v : faces[f])
                item.box.grow(positions[v]);
            for (size_t a = 0; a < 3; ++a)
                item.center[a] = 0.5f * item.box.low[a] + 0.5f * item.box.high[a];
        }
    }

    Bvh build()
    {
        bvh_.nodes.emplace_back();
        const size_t middle = items_.size() > kBvhLeafTriangles ? split(0, items_.size(), 0) : items_.size();
        fill(0, 0, middle, items_.size(), 0);
        for (const Item& item : items_)
            bvh_.order.push_back(item.triangle);
        return std::move(bvh_);
    }

  private:
    Box bounds(size_t first, size_t last) const
    {
        Box box;
        for (size_t i = first; i < last; ++i)
            box.grow(items_[i].box);
        return box;
    }

    // children [first, middle) and [middle, last) of a node that exists
    void fill(uint32_t node, size_t first, size_t middle, size_t last, uint32_t depth)
    {
        const size_t from[] = {first, middle}, to[] = {middle, last};
        for (size_t child = 0; child < 2; ++child) {
            const Box box = bounds(from[child], to[child]);
            const uint32_t reference = make_child(from[child], to[child], depth + 1);
            auto& out = bvh_.nodes[node];
            for (size_t a = 0; a < 3; ++a) {
                out[8 * child + a] = std::bit_cast<uint32_t>(box.low[a]);
                out[8 * child + 4 + a] = std::bit_cast<uint32_t>(box.high[a]);
            }
            out[3 + 4 * child] = reference;
        }
    }

    uint32_t make_child(size_t first, size_t last, uint32_t depth)
    {
        if (last - first <= kBvhLeafTriangles)
            return kBvhLeaf | uint32_t(last - first) << 28 | uint32_t(first);
        const uint32_t node = uint32_t(bvh_.nodes.size());
        bvh_.nodes.emplace_back();
        fill(node, first, split(first, last, depth), last, depth);
        return node;
    }

    // orders items and says where the second child begins
    size_t split(size_t first, size_t last, uint32_t depth)
    {
        Box centers;
        for (size_t i = first; i < last; ++i)
            centers.grow(items_[i].center);
        size_t axis = 0;
        for (size_t a = 1; a < 3; ++a)
            if (centers.high[a] - centers.low[a] > centers.high[axis] - centers.low[axis])
                axis = a;
        const float low = centers.low[axis], extent = centers.high[axis] - low;
        if (depth < kHalvingDepth && extent > 0) {
            const int bin = best_bin(first, last, axis, low, extent);
            const auto begin = items_.begin() + int64_t(first), end = items_.begin() + int64_t(last);
            const auto middle = std::stable_partition(
                begin, end, [&](const Item& i) { return bin_of(i.center[axis], low, extent) <= bin; });
            if (middle != begin && middle != end)
                return size_t(middle - items_.begin());
        }
        const size_t middle = first + (last - first) / 2;
        std::nth_element(items_.begin() + int64_t(first), items_.begin() + int64_t(middle),
                         items_.begin() + int64_t(last), [axis](const Item& a, const Item& b) {
                             return a.center[axis] != b.center[axis] ? a.center[axis] < b.center[axis]
                                                                     : a.triangle < b.triangle;
                         });
        return middle;
    }

    static int bin_of(float center, float low, float extent)
    {
        return std::min(int((center - low) / extent * kBins), kBins - 1);
    }

    // the last bin of the first child with the least area x number
    int best_bin(size_t first, size_t last, size_t axis, float low, float extent) const
    {
        std::array<Box, kBins> boxes;
        std::array<size_t, kBins> counts{};
        for (size_t i = first; i < last; ++i) {
            const int b = bin_of(items_[i].center[axis], low, extent);
            boxes[size_t(b)].grow(items_[i].box);
            ++counts[size_t(b)];
        }
        std::array<double, kBins> right_cost{};
        Box box;
        size_t count = 0;
        for (size_t b = kBins - 1; b > 0; --b) {
            box.grow(boxes[b]);
            count += counts[b];
            right_cost[b - 1] = box.area() * double(count);
        }
        box = {};
        count = 0;
        int best = 0;
        double least = std::numeric_limits<double>::infinity();
        for (size_t b = 0; b + 1 < kBins; ++b) {
            box.grow(boxes[b]);
            count += counts[b];
            const double cost = box.area() * double(count) + right_cost[b];
            if (cost < least) {
                least = cost;
                best = int(b);
            }
        }
        return best;
    }

    std::vector<Item> items_;
    Bvh bvh_;
};

} // namespace

Bvh build_bvh(std::span<const std::array<float, 3>> positions, std::span<const std::array<uint32_t, 3>> faces)
{
    SR_ASSERT(faces.size() < (1u << 28), "build_bvh: {} triangles", faces.size());
    return Builder(positions, faces).build();
}

} // namespace semrover
