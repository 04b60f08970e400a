// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/bvh.h"

#include <algorithm>
#include <bit>
#include <gtest/gtest.h>
#include <random>

namespace semrover {
namespace engine_bvh_test {

struct Soup {
    std::vector<std::array<float, 3>> positions;
    std::vector<std::array<uint32_t, 3>> faces;

    void add(const std::array<float, 3>& a, const std::array<float, 3>& b, const std::array<float, 3>& c)
    {
        const uint32_t i = uint32_t(positions.size());
        positions.insert(positions.end(), {a, b, c});
        faces.push_back({i, i + 1, i + 2});
    }
};

Soup random_soup(uint32_t count, float size, uint32_t seed)
{
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> at(-10, 10), off(-size, size);
    Soup s;
    for (uint32_t i = 0; i < count; ++i) {
        const std::array<float, 3> a = {at(random), at(random), at(random)};
        s.add(a, {a[0] + off(random), a[1] + off(random), a[2] + off(random)},
              {a[0] + off(random), a[1] + off(random), a[2] + off(random)});
    }
    return s;
}

// walks down, checking that boxes hold what is below them
class Walk {
  public:
    Walk(const Soup& soup, const Bvh& bvh) : soup_(soup), bvh_(bvh), seen_(soup.faces.size()) {}

    void run()
    {
        node(0, 1);
        for (size_t i = 0; i < seen_.size(); ++i)
            ASSERT_EQ(seen_[i], 1) << "triangle " << i;
    }
    uint32_t deepest = 0;

  private:
    using Bounds = std::array<float, 6>;

    void node(uint32_t index, uint32_t depth)
    {
        ASSERT_LT(index, bvh_.nodes.size());
        deepest = std::max(deepest, depth);
        const auto& n = bvh_.nodes[index];
        for (size_t child = 0; child < 2; ++child) {
            Bounds box;
            for (size_t a = 0; a < 3; ++a) {
                box[a] = std::bit_cast<float>(n[8 * child + a]);
                box[3 + a] = std::bit_cast<float>(n[8 * child + 4 + a]);
            }
            const uint32_t reference = n[3 + 4 * child];
            stack_.push_back(box);
            reference& kBvhLeaf ? leaf(reference) : node(reference, depth + 1);
            stack_.pop_back();
        }
    }
    void leaf(uint32_t reference)
    {
        const uint32_t first = reference & 0x0fffffff, count = (reference >> 28) & 7;
        ASSERT_LE(count, kBvhLeafTriangles);
        for (uint32_t i = first; i < first + count; ++i) {
            ++seen_.at(bvh_.order.at(i));
            for (uint32_t v : soup_.faces[bvh_.order[i]])
                for (const Bounds& box : stack_)
                    for (size_t a = 0; a < 3; ++a) {
                        ASSERT_GE(soup_.positions[v][a], box[a]);
                        ASSERT_LE(soup_.positions[v][a], box[3 + a]);
                    }
        }
    }

    const Soup& soup_;
    const Bvh& bvh_;
    std::vector<int> seen_;
    std::vector<Bounds> stack_;
};

TEST(engine_bvh, holds_every_triangle_once_inside_all_boxes_above_it)
{
    for (uint32_t count : {0u, 1u, 4u, 5u, 9u, 1000u, 20000u}) {
        const Soup soup = random_soup(count, 0.5f, count);
        const Bvh bvh = build_bvh(soup.positions, soup.faces);
        Walk walk(soup, bvh);
        walk.run();
        EXPECT_LE(walk.deepest, kBvhDepth);
    }
}

TEST(engine_bvh, stays_shallow_when_triangles_coincide_or_crowd)
{
    Soup same, crowd;
    for (int i = 0; i < 5000; ++i)
        same.add({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
    float x = 1; // ever closer together: bins by area split off one at a time
    for (int i = 0; i < 3000; ++i, x *= 0.93f)
        crowd.add({x, 0, 0}, {x, x, 0}, {x, 0, x});
    for (const Soup* soup : {&same, &crowd}) {
        const Bvh bvh = build_bvh(soup->positions, soup->faces);
        Walk walk(*soup, bvh);
        walk.run();
        EXPECT_LE(walk.deepest, kBvhDepth);
    }
}

TEST(engine_bvh, is_the_same_for_the_same_triangles)
{
    const Soup soup = random_soup(3000, 2, 5);
    const Bvh a = build_bvh(soup.positions, soup.faces), b = build_bvh(soup.positions, soup.faces);
    EXPECT_EQ(a.nodes, b.nodes);
    EXPECT_EQ(a.order, b.order);
}

} // namespace engine_bvh_test
} // namespace semrover
