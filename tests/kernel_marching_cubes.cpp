// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "kernels/fusion.h"
#include "tests/support/kernel_case.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <set>

namespace semrover {
namespace kernel_marching_cubes_test {

using Voxel = std::array<int, 3>;
using Position = std::array<double, 3>;

Voxel corner_of(const Voxel& cell, uint32_t c)
{
    return {cell[0] + int(c & 1), cell[1] + int(c >> 1 & 1), cell[2] + int(c >> 2)};
}

// a field on the blocks of a box; voxels outside them are unobserved
struct Field {
    std::array<uint32_t, 3> box;
    std::vector<uint32_t> blocks; // ascending
    std::vector<float> distances;
    std::vector<uint32_t> attributes;
    uint32_t min_views = 0;
    float max_jump = 4;

    Field(std::array<uint32_t, 3> size, double share_of_blocks, std::mt19937& random,
          const std::function<float(const Voxel&)>& distance)
        : box(size)
    {
        for (uint32_t id = 0; id < box[0] * box[1] * box[2]; ++id)
            if (double(random() % 1000) < share_of_blocks * 1000)
                blocks.push_back(id);
        for (const uint32_t id : blocks)
            for (uint32_t l = 0; l < kTsdfBlockVoxels; ++l) {
                distances.push_back(distance(voxel_of(id, l)));
                attributes.push_back(uint32_t(random()));
            }
    }
    Voxel voxel_of(uint32_t id, uint32_t l) const
    {
        return {int(id % box[0] * 8 + l % 8), int(id / box[0] % box[1] * 8 + l / 8 % 8),
                int(id / (box[0] * box[1]) * 8 + l / 64)};
    }
    std::optional<size_t> find(const Voxel& v) const
    {
        for (size_t axis = 0; axis < 3; ++axis)
            if (v[axis] < 0 || v[axis] >= int(box[axis] * 8))
                return {};
        const uint32_t id = (uint32_t(v[2] / 8) * box[1] + uint32_t(v[1] / 8)) * box[0] + uint32_t(v[0] / 8);
        const auto at = std::ranges::lower_bound(blocks, id);
        if (at == blocks.end() || *at != id)
            return {};
        return size_t(at - blocks.begin()) * 512 + size_t((v[2] % 8 * 8 + v[1] % 8) * 8 + v[0] % 8);
    }
    // signs of the corners of a cell that makes surface
    std::optional<uint32_t> signs(const Voxel& cell) const
    {
        float least = 2, most = -2;
        uint32_t bits = 0, views = 0;
        for (uint32_t c = 0; c < 8; ++c) {
            const auto at = find(corner_of(cell, c));
            if (!at || distances[*at] > 1.5f)
                return {};
            least = std::min(least, distances[*at]);
            most = std::max(most, distances[*at]);
            bits |= uint32_t(distances[*at] < 0) << c;
            views = std::max(views, attributes[*at] >> 29);
        }
        return bits != 0 && bits != 255 && views >= min_views && most - least <= max_jump ? std::optional(bits)
                                                                                          : std::nullopt;
    }
};

struct Surface {
    std::vector<Position> positions;
    std::vector<uint32_t> attributes;
    std::vector<std::array<uint32_t, 3>> faces;
};

// the device's answer; positions in voxels of the box
Surface extract(const Field& f, uint32_t ranges)
{
    KernelCase k(test_device());
    Graph& g = k.graph;
    std::vector<uint32_t> bitmap(divide_up(f.box[0] * f.box[1] * f.box[2], 32)), ranks(bitmap.size());
    for (const uint32_t id : f.blocks)
        bitmap[id / 32] |= 1u << id % 32;
    for (size_t w = 1; w < ranks.size(); ++w)
        ranks[w] = ranks[w - 1] + uint32_t(std::popcount(bitmap[w - 1]));
    MarchingCubesField field{f.box[0],
                             f.box[1],
                             f.box[2],
                             k.input(bitmap),
                             k.input(ranks),
                             k.input(f.blocks),
                             k.input(f.distances),
                             k.input(f.attributes),
                             f.min_views,
                             f.max_jump};
    const uint32_t blocks = uint32_t(f.blocks.size()), voxels = blocks * 512;
    const auto out = [&](uint32_t rows) { return k.output(rows, 1, DType::u32, 1); };
    const MarchingCubesCounts counts{out(voxels), out(voxels), out(blocks), out(blocks), out(1), out(1)};
    const Tensor table = k.input(marching_cubes_table());
    marching_cubes_count(g, field, table, counts);
    EXPECT_TRUE(k.compile_and_run());
    std::vector<uint32_t> first_vertex = k.read_array<uint32_t>(counts.first_vertex);
    std::vector<uint32_t> first_face = k.read_array<uint32_t>(counts.first_face);
    first_vertex.push_back(k.read_array<uint32_t>(counts.vertices)[0]);
    first_face.push_back(k.read_array<uint32_t>(counts.faces)[0]);
    Surface s;
    for (uint32_t part = 0; part < ranges; ++part) {
        const uint32_t from = blocks * part / ranges, to = blocks * (part + 1) / ranges;
        const uint32_t vertices = first_vertex[to] - first_vertex[from], faces = first_face[to] - first_face[from];
        const MarchingCubesRange range{from, to - from, first_vertex[from], first_face[from]};
        const Tensor v = k.output(std::max(vertices, 1u), 4, DType::f32, 4);
        const Tensor t = k.output(std::max(faces, 1u), 3, DType::u32, 3);
        if (to > from) {
            marching_cubes_vertices(g, field, counts, range, v);
            marching_cubes_faces(g, field, counts, table, range, t);
            EXPECT_TRUE(k.compile_and_run());
        }
        const std::vector<float> rows = k.read_array<float>(v);
        for (uint32_t b = from; b < to; ++b)
            for (uint32_t i = first_vertex[b] - first_vertex[from]; i < first_vertex[b + 1] - first_vertex[from]; ++i) {
                const Voxel base = f.voxel_of(f.blocks[b], 0);
                s.positions.push_back({base[0] + double(rows[4 * i]), base[1] + double(rows[4 * i + 1]),
                                       base[2] + double(rows[4 * i + 2])});
                s.attributes.push_back(std::bit_cast<uint32_t>(rows[4 * i + 3]));
            }
        const std::vector<uint32_t> corners = k.read_array<uint32_t>(t);
        for (uint32_t i = 0; i < faces; ++i)
            s.faces.push_back({corners[3 * i], corners[3 * i + 1], corners[3 * i + 2]});
    }
    return s;
}

// vertices of a naive walk over all cells, by the edge they lie on (lower voxel, axis), and triangles of such edges
using Edge = std::array<int, 4>;
struct Reference {
    std::map<Edge, Position> vertices;
    std::multiset<std::array<Edge, 3>> faces; // turned so that the least edge comes first
    size_t border_edges = 0;                  // segments on faces of cells without a neighbour
};

Reference reference(const Field& f)
{
    static const std::vector<uint32_t> table = marching_cubes_table();
    Reference r;
    for (const uint32_t id : f.blocks)
        for (uint32_t l = 0; l < 512; ++l) {
            const Voxel cell = f.voxel_of(id, l);
            const auto signs = f.signs(cell);
            if (!signs)
                continue;
            const auto edge_of = [&](uint32_t e) {
                const uint32_t a = e / 4;
                Edge edge{cell[0], cell[1], cell[2], int(a)};
                edge[(a + 1) % 3] += int(e & 1);
                edge[(a + 2) % 3] += int(e >> 1 & 1);
                Voxel low = {edge[0], edge[1], edge[2]}, high = low;
                ++high[a];
                const double d = f.distances[*f.find(low)], h = f.distances[*f.find(high)];
                Position p = {double(low[0]), double(low[1]), double(low[2])};
                p[a] += d / (d - h);
                r.vertices[edge] = p;
                return edge;
            };
            const uint32_t* row = &table[*signs * 16];
            for (uint32_t t = 0; t < row[0]; ++t) {
                std::array<Edge, 3> face = {edge_of(row[1 + 3 * t]), edge_of(row[2 + 3 * t]), edge_of(row[3 + 3 * t])};
                std::ranges::rotate(face, std::ranges::min_element(face));
                r.faces.insert(face);
            }
            for (uint32_t face = 0; face < 6; ++face) {
                Voxel next = cell;
                next[face / 2] += face % 2 ? 1 : -1;
                if (f.signs(next))
                    continue;
                uint32_t crossings = 0;
                for (uint32_t c = 0; c < 8; ++c)
                    for (uint32_t d = c + 1; d < 8; ++d)
                        if (std::popcount(c ^ d) == 1 && (c >> face / 2 & 1) == face % 2 &&
                            (d >> face / 2 & 1) == face % 2)
                            crossings += (*signs >> c ^ *signs >> d) & 1;
                r.border_edges += crossings / 2;
            }
        }
    return r;
}

size_t border_edges(const Surface& s)
{
    std::map<std::pair<uint32_t, uint32_t>, int> directed;
    for (const auto& face : s.faces)
        for (size_t i = 0; i < 3; ++i)
            ++directed[{face[i], face[(i + 1) % 3]}];
    size_t border = 0;
    for (const auto& [edge, count] : directed) {
        EXPECT_EQ(count, 1) << edge.first << "-" << edge.second;
        border += !directed.count({edge.second, edge.first});
    }
    return border;
}

// the edge that a vertex lies on: distances away from 0 keep it away from the ends
Edge edge_at(const Position& p)
{
    Edge edge{};
    double most = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
        edge[axis] = int(std::lround(p[axis]));
        if (const double off = std::abs(p[axis] - edge[axis]); off > most) {
            most = off;
            edge[3] = int(axis);
        }
    }
    edge[size_t(edge[3])] = int(std::floor(p[size_t(edge[3])]));
    return edge;
}

void check(const Field& f, uint32_t ranges)
{
    const Surface s = extract(f, ranges);
    const Reference r = reference(f);
    ASSERT_EQ(s.positions.size(), r.vertices.size());
    ASSERT_EQ(s.faces.size(), r.faces.size());
    EXPECT_EQ(border_edges(s), r.border_edges);
    std::vector<Edge> edges;
    for (const Position& p : s.positions) {
        const auto expected = r.vertices.find(edges.emplace_back(edge_at(p)));
        ASSERT_TRUE(expected != r.vertices.end()) << "no vertex at " << p[0] << " " << p[1] << " " << p[2];
        for (size_t axis = 0; axis < 3; ++axis)
            ASSERT_NEAR(p[axis], expected->second[axis], 2e-6);
    }
    EXPECT_EQ(std::set<Edge>(edges.begin(), edges.end()).size(), edges.size());
    std::multiset<std::array<Edge, 3>> faces;
    for (const auto& face : s.faces) {
        std::array<Edge, 3> corners = {edges[face[0]], edges[face[1]], edges[face[2]]};
        std::ranges::rotate(corners, std::ranges::min_element(corners));
        faces.insert(corners);
    }
    EXPECT_TRUE(faces == r.faces);
}

// one of a few values away from 0 and each other, so that a vertex has a place of its own
float random_distance(std::mt19937& random, double unobserved)
{
    if (double(random() % 1000) < unobserved * 1000)
        return 2;
    const float magnitude = 0.1f + 0.8f * float(random() % 1024) / 1024;
    return random() % 2 ? magnitude : -magnitude;
}

TEST(kernel_marching_cubes, noise_with_holes_has_the_vertices_and_faces_of_a_naive_walk)
{
    struct Case {
        std::array<uint32_t, 3> box;
        double blocks, unobserved;
        uint32_t min_views, ranges;
    };
    // one block; all of a box; a sparse box; mostly unobserved; seen by few; nothing at all
    for (const Case& c :
         {Case{{1, 1, 1}, 1, 0, 0, 1}, Case{{2, 3, 2}, 1, 0, 0, 3}, Case{{4, 3, 5}, 0.5, 0.01, 0, 2},
          Case{{3, 3, 3}, 0.9, 0.2, 0, 1}, Case{{2, 2, 3}, 1, 0.02, 7, 2}, Case{{2, 2, 2}, 1, 1, 0, 1}}) {
        SCOPED_TRACE(fmt::format("{} x {} x {} blocks, {} of them", c.box[0], c.box[1], c.box[2], c.blocks));
        std::mt19937 random(7);
        Field f(c.box, c.blocks, random, [&](const Voxel&) { return random_distance(random, c.unobserved); });
        f.min_views = c.min_views;
        f.max_jump = c.ranges == 3 ? 1.3f : 4;
        check(f, c.ranges);
    }
}

TEST(kernel_marching_cubes, a_sphere_is_closed_and_turned_outwards)
{
    std::mt19937 random(3);
    const double radius = 9.3;
    const Position middle = {11.6, 12.2, 11.9};
    const Field f({3, 3, 3}, 1, random, [&](const Voxel& v) {
        return float((std::hypot(v[0] - middle[0], v[1] - middle[1], v[2] - middle[2]) - radius) / 16);
    });
    const Surface s = extract(f, 2);
    EXPECT_EQ(border_edges(s), 0u);
    EXPECT_EQ(s.positions.size() - s.faces.size() * 3 / 2 + s.faces.size(), 2u) << "Euler's number";
    double volume = 0;
    for (const auto& [a, b, c] : s.faces) {
        const Position &p = s.positions[a], &q = s.positions[b], &r = s.positions[c];
        volume += (p[0] * (q[1] * r[2] - q[2] * r[1]) - p[1] * (q[0] * r[2] - q[2] * r[0]) +
                   p[2] * (q[0] * r[1] - q[1] * r[0])) /
                  6;
    }
    EXPECT_NEAR(volume, 4.0 / 3 * std::numbers::pi * std::pow(radius, 3),
                0.02 * 4.0 / 3 * std::numbers::pi * std::pow(radius, 3));
    for (const Position& p : s.positions)
        ASSERT_NEAR(std::hypot(p[0] - middle[0], p[1] - middle[1], p[2] - middle[2]), radius, 0.03);
}

TEST(kernel_marching_cubes, smooth_fields_are_closed_where_they_do_not_leave_the_box)
{
    for (const uint32_t seed : {1u, 2u, 3u}) {
        std::mt19937 random(seed);
        std::normal_distribution<double> normal;
        std::array<std::array<double, 4>, 6> waves;
        for (auto& wave : waves)
            for (double& v : wave)
                v = normal(random) * 0.25;
        const Field f({4, 4, 4}, 1, random, [&](const Voxel& v) {
            double d = 0.3, inside = 1e9;
            for (const auto& w : waves)
                d += std::sin(w[0] * v[0] + w[1] * v[1] + w[2] * v[2] + 9 * w[3]) / 3;
            for (const int x : v)
                inside = std::min({inside, x - 1.5, 29.5 - x});
            return float(std::max(d, -inside) / 8); // cut off at the box's border
        });
        const Surface s = extract(f, 1);
        EXPECT_GT(s.faces.size(), 1000u);
        EXPECT_EQ(border_edges(s), 0u) << seed;
    }
}

TEST(kernel_marching_cubes, colours_are_mixed_labels_are_of_the_nearer_end)
{
    std::mt19937 random(1);
    Field f({1, 1, 1}, 1, random, [](const Voxel& v) { return v[0] < 4 ? -0.25f : 0.75f; }); // crosses at 3.25
    for (uint32_t l = 0; l < 512; ++l)
        f.attributes[l] = l % 8 < 4 ? 0x21000064u | 5u << 29 : 0x020000c8u | 1u << 29; // label 1; label 2
    for (const uint32_t a : extract(f, 1).attributes)
        ASSERT_EQ(a, 0x01000000u | 125u | 5u << 29);
    for (uint32_t l = 0; l < 512; ++l)
        f.attributes[l] = l % 8 < 4 ? 31u << 24 | 0x64u | 1u << 29 : 0x020000c8u; // no label; no colour
    for (const uint32_t a : extract(f, 1).attributes)
        ASSERT_EQ(a, 0x02000000u | 0x64u | 1u << 29);
}

TEST(kernel_marching_cubes, every_case_of_the_table_uses_each_crossed_edge_and_its_border_is_made_of_loops)
{
    const std::vector<uint32_t> table = marching_cubes_table();
    for (uint32_t signs = 0; signs < 256; ++signs) {
        const uint32_t* row = &table[signs * 16];
        std::set<uint32_t> used, crossed;
        std::map<std::pair<uint32_t, uint32_t>, int> directed;
        for (uint32_t t = 0; t < row[0]; ++t)
            for (uint32_t i = 0; i < 3; ++i) {
                used.insert(row[1 + 3 * t + i]);
                ++directed[{row[1 + 3 * t + i], row[1 + 3 * t + (i + 1) % 3]}];
            }
        for (uint32_t e = 0; e < 12; ++e) {
            const uint32_t a = e / 4, low = (e & 1) << (a + 1) % 3 | (e >> 1 & 1) << (a + 2) % 3, high = low | 1u << a;
            if ((signs >> low ^ signs >> high) & 1)
                crossed.insert(e);
        }
        EXPECT_EQ(used, crossed) << signs;
        std::map<uint32_t, int> open; // every crossed edge lies on two segments of the cell's border: one in, one out
        for (const auto& [edge, count] : directed) {
            EXPECT_EQ(count, 1) << signs;
            if (!directed.count({edge.second, edge.first})) {
                open[edge.first] += 1;
                open[edge.second] += 16;
            }
        }
        for (const uint32_t e : crossed)
            EXPECT_EQ(open[e], 17) << signs << " edge " << e;
    }
}

} // namespace kernel_marching_cubes_test
} // namespace semrover
