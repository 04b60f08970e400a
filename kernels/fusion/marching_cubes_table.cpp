// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// The 256 cases of marching cubes, derived instead of typed. On every face of the cube, walked counter-clockwise seen
// from outside, each run of inside corners is cut off by one segment, from the edge where the run begins to the edge
// where it ends. Both cells of a face see the same segments, so there are no cracks. Segments chain to loops of 3 to 7
// edges; a loop is cut into triangles without a diagonal in a face of the cube, where the neighbour might have the
// same.
#include "kernels/fusion.h"

#include <array>
#include <optional>

namespace semrover {

namespace {

using Loop = std::vector<uint32_t>;                     // edges
using Triangles = std::vector<std::array<uint32_t, 3>>; // edges

// corner: bit per axis; edge: axis * 4 + offsets along the next two axes
uint32_t edge_of(uint32_t corner, uint32_t axis)
{
    return axis * 4 + (corner >> (axis + 1) % 3 & 1) + 2 * (corner >> (axis + 2) % 3 & 1);
}

uint32_t edge_between(uint32_t c, uint32_t d)
{
    const uint32_t axis = (c ^ d) == 1 ? 0 : (c ^ d) == 2 ? 1 : 2;
    return edge_of(c & d, axis);
}

// corners of face (axis, side), counter-clockwise seen from outside
std::array<uint32_t, 4> face_corners(uint32_t axis, uint32_t side)
{
    const uint32_t b = 1u << (axis + 1) % 3, c = 1u << (axis + 2) % 3, at = side << axis;
    if (side)
        return {at, at | b, at | b | c, at | c};
    return {at | c, at | b | c, at | b, at};
}

// next[e]: edge that follows e on the boundary of the surface in this cell, none for an edge that is not crossed
std::array<std::optional<uint32_t>, 12> segments_of(uint32_t signs)
{
    std::array<std::optional<uint32_t>, 12> next;
    for (uint32_t f = 0; f < 6; ++f) {
        const auto corners = face_corners(f / 2, f % 2);
        const auto inside = [&](uint32_t i) { return signs >> corners[i % 4] & 1; };
        for (uint32_t i = 0; i < 4; ++i) {
            if (!inside(i) || inside(i + 3))
                continue;
            uint32_t last = i;
            while (inside(last + 1))
                ++last;
            next[edge_between(corners[(i + 3) % 4], corners[i])] =
                edge_between(corners[last % 4], corners[(last + 1) % 4]);
        }
    }
    return next;
}

// do two edges lie in one face of the cube?
bool share_face(uint32_t e, uint32_t f)
{
    const auto faces = [](uint32_t edge) { // a bit for each of the six
        const uint32_t b = (edge / 4 + 1) % 3, c = (edge / 4 + 2) % 3;
        return 1u << (2 * b + (edge & 1)) | 1u << (2 * c + (edge >> 1 & 1));
    };
    return (faces(e) & faces(f)) != 0;
}

// triangles of the part of a loop between positions i and j, which the line i-j closes; none if there are none without
// a diagonal in a face
std::optional<Triangles> triangulate(const Loop& loop, size_t i, size_t j)
{
    if (j - i < 2)
        return Triangles{};
    const auto allowed = [&](size_t a, size_t b) { return b - a == 1 || !share_face(loop[a], loop[b]); };
    for (size_t k = i + 1; k < j; ++k) {
        if (!allowed(i, k) || !allowed(k, j))
            continue;
        auto low = triangulate(loop, i, k), high = triangulate(loop, k, j);
        if (!low || !high)
            continue;
        low->push_back({loop[i], loop[k], loop[j]});
        low->insert(low->end(), high->begin(), high->end());
        return low;
    }
    return std::nullopt;
}

Triangles triangles_of(uint32_t signs)
{
    auto next = segments_of(signs);
    Triangles triangles;
    for (uint32_t start = 0; start < 12; ++start) {
        Loop loop;
        for (uint32_t edge = start; next[edge];) {
            loop.push_back(edge);
            edge = *std::exchange(next[edge], std::nullopt);
        }
        if (loop.empty())
            continue;
        const auto found = triangulate(loop, 0, loop.size() - 1);
        SR_ASSERT(found, "marching cubes: no triangles for case {}", signs);
        triangles.insert(triangles.end(), found->begin(), found->end());
    }
    return triangles;
}

} // namespace

std::vector<uint32_t> marching_cubes_table()
{
    std::vector<uint32_t> table(256 * 16);
    for (uint32_t signs = 0; signs < 256; ++signs) {
        const Triangles triangles = triangles_of(signs);
        SR_ASSERT(triangles.size() <= 5, "marching cubes: {} triangles in case {}", triangles.size(), signs);
        uint32_t* row = &table[signs * 16];
        *row++ = uint32_t(triangles.size());
        for (const auto& triangle : triangles)
            for (const uint32_t edge : triangle)
                *row++ = edge;
    }
    return table;
}

} // namespace semrover
