// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/mesh_readers.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace semrover {

namespace {

constexpr size_t kMaxEars = 256; // corners; cutting takes the square of their number

using Flat = std::array<double, 2>;
using Triangles = std::vector<std::array<uint32_t, 3>>;

// along the normal's largest axis (Newell), counter-clockwise
std::vector<Flat> flattened(std::span<const std::array<double, 3>> p)
{
    std::array<double, 3> n{};
    for (size_t i = 0; i < p.size(); ++i) {
        const auto &a = p[i], &b = p[(i + 1) % p.size()];
        for (size_t k = 0; k < 3; ++k) {
            const size_t u = (k + 1) % 3, v = (k + 2) % 3;
            n[k] += (a[u] - b[u]) * (a[v] + b[v]);
        }
    }
    size_t axis = 0;
    for (size_t k = 1; k < 3; ++k)
        if (std::abs(n[k]) > std::abs(n[axis]))
            axis = k;
    std::vector<Flat> flat;
    for (const auto& c : p)
        flat.push_back({c[(axis + 1) % 3], n[axis] < 0 ? -c[(axis + 2) % 3] : c[(axis + 2) % 3]});
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

// Cuts ears off a polygon. What was found to lie outside a corner's triangle stays there until a neighbour of the
// corner goes, so no test is made twice: all tests together are as many as the square of the corners.
class EarCutter {
  public:
    explicit EarCutter(std::vector<Flat> corners) : p_(std::move(corners)), left_(p_.size()), clear_(p_.size())
    {
        std::iota(left_.begin(), left_.end(), 0u);
    }

    // the first ear goes to `out`; false when there is none
    bool cut(Triangles& out)
    {
        for (size_t at = 0; at < left_.size(); ++at) {
            const size_t n = left_.size();
            const uint32_t a = left_[(at + n - 1) % n], b = left_[at], c = left_[(at + 1) % n];
            if (!is_ear(a, b, c))
                continue;
            out.push_back({a, b, c});
            left_.erase(left_.begin() + ptrdiff_t(at));
            clear_[a] = clear_[c] = 0;
            return true;
        }
        return false;
    }

    const std::vector<uint32_t>& left() const { return left_; }

  private:
    bool is_ear(uint32_t a, uint32_t b, uint32_t c)
    {
        if (turn(p_[a], p_[b], p_[c]) <= 0)
            return false;
        for (auto i = std::ranges::lower_bound(left_, clear_[b]); i != left_.end(); ++i) {
            clear_[b] = *i;
            if (blocks(p_[*i], p_[a], p_[b], p_[c]))
                return false;
        }
        return true;
    }

    // corners at the same place, the triangle's own among them, do not
    static bool blocks(const Flat& x, const Flat& a, const Flat& b, const Flat& c)
    {
        return x != a && x != b && x != c && turn(a, b, x) >= 0 && turn(b, c, x) >= 0 && turn(c, a, x) >= 0;
    }

    std::vector<Flat> p_;
    std::vector<uint32_t> left_;  // corners that are not cut yet, ascending
    std::vector<uint32_t> clear_; // of a corner: those below this one do not block it
};

} // namespace

Triangles triangulated(std::span<const std::array<double, 3>> corners)
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
    EarCutter cutter(p);
    Triangles out;
    while (cutter.left().size() > 3)
        if (!cutter.cut(out))
            return fan(count);
    out.push_back({cutter.left()[0], cutter.left()[1], cutter.left()[2]});
    return out;
}

} // namespace semrover
