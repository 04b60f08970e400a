// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/polygon.h"

#include <cmath>
#include <numeric>

namespace semrover {

namespace {

constexpr size_t kMaxEars = 256; // corners; cutting takes the cube of their number

using Flat = std::array<double, 2>;
using Triangles = std::vector<std::array<uint32_t, 3>>;

// along the normal's largest axis (Newell), counter-clockwise
std::vector<Flat> flattened(std::span<const std::array<float, 3>> p)
{
    std::array<double, 3> n{};
    for (size_t i = 0; i < p.size(); ++i) {
        const auto &a = p[i], &b = p[(i + 1) % p.size()];
        for (size_t k = 0; k < 3; ++k) {
            const size_t u = (k + 1) % 3, v = (k + 2) % 3;
            n[k] += (double(a[u]) - b[u]) * (double(a[v]) + b[v]);
        }
    }
    size_t axis = 0;
    for (size_t k = 1; k < 3; ++k)
        if (std::abs(n[k]) > std::abs(n[axis]))
            axis = k;
    std::vector<Flat> flat;
    for (const auto& c : p)
        flat.push_back({c[(axis + 1) % 3], n[axis] < 0 ? -double(c[(axis + 2) % 3]) : double(c[(axis + 2) % 3])});
    return flat;
}

double turn(const Flat& a, const Flat& b, const Flat& c)
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

Triangles fan(uint32_t corners)
{
    Triangles out;
    for (uint32_t i = 1; i + 1 < corners; ++i)
        out.push_back({0, i, i + 1});
    return out;
}

bool is_ear(const std::vector<Flat>& p, const std::vector<uint32_t>& left, size_t at)
{
    const size_t n = left.size();
    const uint32_t ia = left[(at + n - 1) % n], ib = left[at], ic = left[(at + 1) % n];
    const Flat &a = p[ia], &b = p[ib], &c = p[ic];
    if (turn(a, b, c) <= 0)
        return false;
    for (const uint32_t i : left)
        if (i != ia && i != ib && i != ic && p[i] != a && p[i] != b && p[i] != c && turn(a, b, p[i]) >= 0 &&
            turn(b, c, p[i]) >= 0 && turn(c, a, p[i]) >= 0)
            return false;
    return true;
}

} // namespace

Triangles triangulated(std::span<const std::array<float, 3>> corners)
{
    const auto count = uint32_t(corners.size());
    if (count <= 3 || count > kMaxEars)
        return fan(count);
    const std::vector<Flat> p = flattened(corners);
    bool convex = true;
    for (uint32_t i = 0; i < count; ++i)
        convex = convex && turn(p[i], p[(i + 1) % count], p[(i + 2) % count]) >= 0;
    if (convex)
        return fan(count);
    std::vector<uint32_t> left(count);
    std::iota(left.begin(), left.end(), 0u);
    Triangles out;
    while (left.size() > 3) {
        size_t at = 0;
        while (at < left.size() && !is_ear(p, left, at))
            ++at;
        if (at == left.size())
            return fan(count);
        const size_t n = left.size();
        out.push_back({left[(at + n - 1) % n], left[at], left[(at + 1) % n]});
        left.erase(left.begin() + ptrdiff_t(at));
    }
    out.push_back({left[0], left[1], left[2]});
    return out;
}

} // namespace semrover
