// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/mesh/bvh.h"
#include "kernels/mesh.h"
#include "tests/support/clip_reference.h"
#include "tests/support/kernel_case.h"
#include "tests/support/philox_reference.h"

#include <bit>
#include <set>

namespace semrover {
namespace kernel_surface_test {

constexpr uint32_t kNone = 0xffffffff;
constexpr uint32_t kWholeBlock = 8u << 12 | 8u << 16 | 8u << 20;

struct Triangle {
    std::array<Point3d, 3> corners; // voxels, exact as floats
    uint32_t slot = 0, range = kWholeBlock, material = 0, label = 3;
    std::array<std::array<float, 2>, 3> uv{};
    std::array<std::array<float, 3>, 3> color = {{{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}};
};

uint32_t bits_of(double v)
{
    return std::bit_cast<uint32_t>(float(v));
}

std::vector<uint32_t> records_of(const std::vector<Triangle>& triangles)
{
    std::vector<uint32_t> words;
    for (const Triangle& t : triangles) {
        for (const Point3d& c : t.corners)
            for (const double x : c)
                words.push_back(bits_of(x));
        words.insert(words.end(), {t.slot, t.range, t.material | t.label << 24});
    }
    return words;
}

std::vector<uint32_t> attributes_of(const std::vector<Triangle>& triangles)
{
    std::vector<uint32_t> words;
    for (const Triangle& t : triangles) {
        for (const auto& uv : t.uv)
            words.insert(words.end(), {bits_of(uv[0]), bits_of(uv[1])});
        for (const auto& c : t.color)
            words.insert(words.end(), {bits_of(c[0]), bits_of(c[1]), bits_of(c[2])});
        words.push_back(0);
    }
    return words;
}

// material 0 is plain; 1 has texture 0 (5 x 3, repeat and mirror, from texel 7 on); 2 says labels with it
const std::vector<uint32_t> kMaterials = {bits_of(1),   bits_of(1), bits_of(1),   kNone, kNone, 0, 0, 0,
                                          bits_of(0.5), bits_of(1), bits_of(0.2), 0,     kNone, 0, 0, 0,
                                          bits_of(1),   bits_of(1), bits_of(1),   kNone, 0,     0, 0, 0};
const std::vector<uint32_t> kTextures = {5, 3, 7, 0 | 1 << 2};

SurfaceTriangles surface_in(KernelCase& k, const std::vector<Triangle>& triangles)
{
    return {k.input(records_of(triangles), 12), k.input(attributes_of(triangles), 16), k.input(kMaterials, 8),
            k.input(kTextures, 4), k.input(std::vector<uint32_t>{0})};
}

// corners on multiples of 2^-20, as the voxelizer rounds them
std::vector<Triangle> random_triangles(uint32_t count, double extent, uint32_t seed)
{
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> place(-1, 9), offset(-extent, extent);
    std::vector<Triangle> list(count);
    for (Triangle& t : list) {
        const Point3d middle = {place(random), place(random), place(random)};
        for (Point3d& c : t.corners)
            for (size_t a = 0; a < 3; ++a)
                c[a] = std::round((middle[a] + offset(random)) * 0x1p20) * 0x1p-20;
        t.slot = uint32_t(random() % 3);
        t.label = uint32_t(random() % 21);
        for (auto& uv : t.uv)
            uv = {float(offset(random)), float(offset(random))};
    }
    return list;
}

std::array<int, 3> cell_of(uint32_t key)
{
    return {int(key % 512 / 64), int(key / 8 % 8), int(key % 8)};
}

Tensor kept(KernelCase& k, Tensor y)
{
    const Tensor out = k.output(y.rows, y.cols, y.dtype, y.ld);
    k.graph.keep(y, out);
    return out;
}

TEST(kernel_surface, triangle_cells_finds_every_cell_with_area_once_and_none_outside_box_and_range)
{
    for (const auto& [count, extent] : {std::pair{1u, 2.0}, {64u, 0.05}, {300u, 1.0}, {1000u, 3.9}}) {
        std::vector<Triangle> triangles = random_triangles(count, extent, 5);
        for (uint32_t i = 0; i < count; i += 3)
            triangles[i].range = 2 | 0 << 4 | 4 << 8 | 4 << 12 | 8 << 16 | 8 << 20;
        KernelCase k(test_device());
        const uint32_t capacity = count * 512;
        const SurfacePairs pairs = triangle_cells(k.graph, k.input(records_of(triangles), 12), capacity);
        const Tensor keys = kept(k, pairs.keys), values = kept(k, pairs.triangles), total = kept(k, pairs.count);
        ASSERT_TRUE(k.compile_and_run());
        const auto got_codes = k.read_array<uint32_t>(keys), got_values = k.read_array<uint32_t>(values);
        std::vector<uint32_t> got_keys;
        for (const uint32_t code : got_codes)
            got_keys.push_back(code >> kSurfacePlaceBits);
        const uint32_t found = k.read_array<uint32_t>(total)[0];
        ASSERT_LE(found, capacity);
        std::set<std::pair<uint32_t, uint32_t>> seen;
        for (uint32_t i = 0; i < found; ++i) {
            const Triangle& t = triangles.at(got_values[i]);
            ASSERT_TRUE(seen.insert({got_values[i], got_keys[i]}).second) << "twice";
            ASSERT_EQ(got_keys[i] / 512, t.slot);
            ASSERT_TRUE(i == 0 || got_values[i - 1] <= got_values[i]);
            const auto cell = cell_of(got_keys[i]);
            uint32_t place = got_codes[i] & 511;
            for (size_t a = 0; a < 3; ++a, place >>= 1) {
                const uint32_t along = (place & 1) | (place >> 3 & 1) << 1 | (place >> 6 & 1) << 2;
                const auto [low, high] = std::minmax({t.corners[0][a], t.corners[1][a], t.corners[2][a]});
                ASSERT_LE(std::floor(low), cell[a]);
                ASSERT_GE(std::floor(high), cell[a]);
                ASSERT_GE(cell[a], int(t.range >> (4 * a) & 15));
                ASSERT_LT(cell[a], int(t.range >> (12 + 4 * a) & 15));
                const double middle = (std::max(low, double(cell[a])) + std::min(high, cell[a] + 1.0)) / 2 - cell[a];
                ASSERT_NEAR(along + 0.5, std::clamp(8 * middle, 0.0, 8.0), 0.5 + 1e-5);
            }
        }
        for (uint32_t i = 0; i < count; ++i)
            for (uint32_t c = 0; c < 512; ++c) {
                const auto cell = cell_of(c);
                bool in_range = true;
                for (size_t a = 0; a < 3; ++a)
                    in_range = in_range && cell[a] >= int(triangles[i].range >> (4 * a) & 15) &&
                               cell[a] < int(triangles[i].range >> (12 + 4 * a) & 15);
                if (in_range && polygon_area(clipped(triangles[i].corners, cell, 1)) > 1e-9) {
                    ASSERT_TRUE(seen.contains({i, triangles[i].slot * 512 + c})) << "triangle " << i << " voxel " << c;
                }
            }
    }
}

// all voxels of all triangles
std::pair<std::vector<uint32_t>, std::vector<uint32_t>> all_pairs(const std::vector<Triangle>& triangles)
{
    std::vector<uint32_t> keys, values;
    for (uint32_t i = 0; i < triangles.size(); ++i)
        for (uint32_t c = 0; c < 512; ++c)
            if (c % 7 == i % 7 || polygon_area(clipped(triangles[i].corners, cell_of(c), 1)) > 0) {
                keys.push_back(triangles[i].slot * 512 + c);
                values.push_back(i);
            }
    return {keys, values};
}

struct Clipped {
    std::vector<float> areas;
    std::vector<uint32_t> labels, addresses;
};

Clipped clip(const std::vector<Triangle>& triangles, const std::vector<uint32_t>& keys,
             const std::vector<uint32_t>& values)
{
    KernelCase k(test_device());
    const SurfacePairs pairs{k.input(keys), k.input(values), k.input(std::vector<uint32_t>{uint32_t(keys.size())})};
    const SurfaceAreas y = clip_area(k.graph, surface_in(k, triangles), pairs);
    const Tensor areas = kept(k, y.areas), labels = kept(k, y.labels), addresses = kept(k, y.label_addresses);
    EXPECT_TRUE(k.compile_and_run());
    return {k.read_array<float>(areas), k.read_array<uint32_t>(labels), k.read_array<uint32_t>(addresses)};
}

TEST(kernel_surface, pair_cells_leaves_what_lies_above_the_place)
{
    KernelCase k(test_device());
    const std::vector<uint32_t> codes = {0, 511, 512, 1023, 0xffffffff, 77u << 9 | 5};
    const Tensor cells = kept(k, pair_cells(k.graph, k.input(codes)));
    ASSERT_TRUE(k.compile_and_run());
    EXPECT_EQ(k.read_array<uint32_t>(cells), (std::vector<uint32_t>{0, 0, 1, 1, 0x7fffff, 77}));
}

TEST(kernel_surface, clip_area_matches_clipping_in_double)
{
    for (const auto& [count, extent] : {std::pair{1u, 2.0}, {7u, 0.01}, {100u, 1.0}, {60u, 7.0}}) {
        const std::vector<Triangle> triangles = random_triangles(count, extent, 6);
        const auto [keys, values] = all_pairs(triangles);
        const Clipped got = clip(triangles, keys, values);
        double sum = 0, expected_sum = 0;
        for (size_t i = 0; i < keys.size(); ++i) {
            const double expected = polygon_area(clipped(triangles[values[i]].corners, cell_of(keys[i]), 1));
            // corners within 16 voxels round by 5e-7 when they are seen from a voxel, and its border is 5.7 long at
            // most
            ASSERT_NEAR(got.areas[i], expected, 4e-6) << "pair " << i;
            ASSERT_EQ(got.labels[i], triangles[values[i]].label);
            sum += got.areas[i];
            expected_sum += expected;
        }
        EXPECT_NEAR(sum, expected_sum, 2e-6 * (1 + expected_sum));
    }
}

TEST(kernel_surface, clip_area_counts_a_triangle_in_the_plane_between_two_cells_in_the_upper_one_only)
{
    std::vector<Triangle> triangles(3);
    for (size_t axis = 0; axis < 3; ++axis)
        for (size_t c = 0; c < 3; ++c) {
            triangles[axis].corners[c][axis] = 3;
            triangles[axis].corners[c][(axis + 1) % 3] = c == 1 ? 2.75 : 2.25;
            triangles[axis].corners[c][(axis + 2) % 3] = c == 2 ? 2.75 : 2.25;
        }
    std::vector<uint32_t> keys, values;
    for (uint32_t i = 0; i < 3; ++i)
        for (uint32_t c = 0; c < 512; ++c) {
            keys.push_back(c);
            values.push_back(i);
        }
    const Clipped got = clip(triangles, keys, values);
    for (size_t i = 0; i < keys.size(); ++i) {
        std::array<int, 3> home = {2, 2, 2};
        home[values[i]] = 3;
        ASSERT_EQ(got.areas[i], cell_of(keys[i]) == home ? 0.125f : 0.f)
            << "axis " << values[i] << " voxel " << keys[i];
    }
}

TEST(kernel_surface, clip_area_says_where_a_label_texture_has_the_label_of_what_is_in_the_cell)
{
    Triangle t; // u runs along x from 0 to 1 over 5 voxels, v along y from 0 to 1 over 3
    t.corners = {{{0, 0, 0.5}, {5, 0, 0.5}, {0, 3, 0.5}}};
    t.uv = {{{0, 0}, {1, 0}, {0, 1}}};
    t.material = 2;
    t.label = kNoSurfaceLabel;
    Triangle labelled = t;
    labelled.label = 4;
    // voxels at the left border, wholly inside: their middle is half a texel from the texel's borders
    const std::vector<uint32_t> keys = {0, 64, 8, 0}, values = {0, 0, 0, 1};
    const Clipped got = clip({t, labelled}, keys, values);
    EXPECT_EQ(got.addresses, (std::vector<uint32_t>{7, 8, 12, kNone}));
    EXPECT_EQ(got.labels[0], kNoSurfaceLabel);
    EXPECT_EQ(got.labels[3], 4u);
}

TEST(kernel_surface, cell_area_sums_in_order_and_gives_ties_to_the_lower_label)
{
    std::mt19937 random(3);
    constexpr uint32_t kCells = 700;
    std::vector<uint32_t> starts = {0}, labels;
    std::vector<float> areas;
    for (uint32_t c = 0; c < kCells; ++c) {
        const uint32_t pairs = c == 5 ? 20000 : uint32_t(random() % 9);
        for (uint32_t i = 0; i < pairs; ++i) {
            areas.push_back(random() % 4 ? float(random() % 1000) / 1024 : 0);
            labels.push_back(uint32_t(random() % 21));
        }
        starts.push_back(uint32_t(areas.size()));
    }
    KernelCase k(test_device());
    const CellAreas y = cell_area(k.graph, k.input(areas), k.input(labels), k.input(starts), kCells);
    const Tensor sums = kept(k, y.sums), cells = kept(k, y.areas), winners = kept(k, y.labels);
    const Tensor unlabelled = kept(k, y.unlabelled);
    ASSERT_TRUE(k.compile_and_run());
    const auto got_sums = k.read_array<float>(sums), got = k.read_array<float>(cells);
    const auto got_unlabelled = k.read_array<float>(unlabelled);
    const auto got_labels = k.read_array<uint32_t>(winners);
    for (uint32_t c = 0; c < kCells; ++c) {
        double sum = 0;
        std::array<double, 21> share{};
        for (uint32_t i = starts[c]; i < starts[c + 1]; ++i) {
            sum += areas[i];
            share[labels[i]] += areas[i]; // multiples of 1/1024 below 2^24 of them: exact in float too
            ASSERT_NEAR(got_sums[i], sum, 1e-7 * sum);
        }
        uint32_t best = kNoSurfaceLabel;
        for (uint32_t l = kNoSurfaceLabel; l-- > 0;)
            if (share[l] > 0 && (best == kNoSurfaceLabel || share[l] >= share[best]))
                best = l;
        ASSERT_NEAR(got[c], sum, 1e-7 * sum) << "voxel " << c;
        ASSERT_EQ(got_labels[c], best) << "voxel " << c;
        ASSERT_EQ(got_unlabelled[c], share[kNoSurfaceLabel]);
    }
}

double unit(uint32_t word)
{
    return (word >> 8) / 16777216.0;
}

struct Drawn {
    Point3d point;
    uint32_t triangle;
    bool near_threshold; // of a choice, where float and double may differ
    double slack;        // of the point, because of rounding
};

// the point of sample k of n of the lattice that the voxel's words shift, among triangles in a voxel
Drawn draw(const std::vector<Triangle>& triangles, const std::vector<uint32_t>& in_cell, const std::array<int, 3>& cell,
           const Words4& words, uint32_t k, uint32_t n)
{
    const double x = unit(words[0] + k * (0xffffffffu / n)), y = unit(words[1] + k * 0x9E3779B9u);
    Drawn d{};
    std::vector<double> sums;
    double all = 0;
    for (const uint32_t t : in_cell)
        sums.push_back(all += polygon_area(clipped(triangles[t].corners, cell, 1)));
    const double target = x * all;
    size_t at = 0;
    while (sums[at] <= target)
        ++at;
    for (const double s : sums)
        d.near_threshold |= std::abs(s - target) < 1e-5;
    d.triangle = in_cell[at];
    const std::vector<Point3d> p = clipped(triangles[d.triangle].corners, cell, 1);
    const double before_pair = at ? sums[at - 1] : 0, into = (target - before_pair) / (sums[at] - before_pair);
    const double fan_target = into * polygon_area(p);
    double before = 0, area = triangle_area(p[0], p[1], p[2]);
    size_t i = 1;
    d.near_threshold |= std::abs(area - fan_target) < 1e-5;
    while (before + area <= fan_target && i + 2 < p.size()) {
        ++i;
        before += area;
        area = triangle_area(p[0], p[i], p[i + 1]);
        d.near_threshold |= std::abs(before + area - fan_target) < 1e-5;
    }
    // note: float sums place the point within a sliver only to about their rounding over its area
    d.slack = 1e-6 / std::max(std::min(area, sums[at] - before_pair), 1e-6);
    const double r = std::sqrt(y), s = std::min((fan_target - before) / area, 1.0);
    for (size_t a = 0; a < 3; ++a)
        d.point[a] = (1 - r) * p[0][a] + r * (1 - s) * p[i][a] + r * s * p[i + 1][a];
    return d;
}

TEST(kernel_surface, sample_surface_draws_what_its_random_words_choose)
{
    std::vector<Triangle> triangles = random_triangles(60, 2.5, 9);
    for (Triangle& t : triangles)
        t.slot = 0;
    KernelCase k(test_device());
    std::vector<uint32_t> values, starts = {0};
    std::vector<float> sums;
    std::vector<int32_t> cells;
    std::vector<std::vector<uint32_t>> in_cells;
    for (uint32_t key = 0; key < 512; ++key) {
        double sum = 0;
        std::vector<uint32_t> in_cell;
        for (uint32_t t = 0; t < triangles.size(); ++t) {
            const double area = polygon_area(clipped(triangles[t].corners, cell_of(key), 1));
            if (area > 1e-3) {
                in_cell.push_back(t);
                sums.push_back(float(sum += area));
            }
        }
        values.insert(values.end(), in_cell.begin(), in_cell.end());
        starts.push_back(uint32_t(values.size()));
        const auto c = cell_of(key);
        if (!in_cell.empty()) {
            cells.insert(cells.end(), {c[0] - 100, c[1] + 7, c[2] - 3, int32_t(key)});
            in_cells.push_back(in_cell);
        }
    }
    constexpr uint32_t kSamples = 13;
    constexpr uint64_t kSeed = 0x123456789abcdef;
    const SurfaceSamples y = sample_surface(k.graph, surface_in(k, triangles), k.input(values), k.input(sums),
                                            k.input(starts), k.input(cells, 4), kSamples, kSeed);
    const Tensor points = kept(k, y.points), addresses = kept(k, y.addresses);
    ASSERT_TRUE(k.compile_and_run());
    const auto got = k.read_array<float>(points);
    const auto texels = k.read_array<uint32_t>(addresses);
    size_t skipped = 0;
    for (uint32_t i = 0; i < in_cells.size() * kSamples; ++i) {
        const int32_t* c = &cells[i / kSamples * 4];
        const Words4 words = philox_reference({uint32_t(c[0]), uint32_t(c[1]), uint32_t(c[2]), 0},
                                              {uint32_t(kSeed), uint32_t(kSeed >> 32)});
        const auto cell = cell_of(uint32_t(c[3]));
        const Drawn expected = draw(triangles, in_cells[i / kSamples], cell, words, i % kSamples, kSamples);
        if (expected.near_threshold) {
            ++skipped;
            continue;
        }
        for (size_t a = 0; a < 3; ++a) {
            ASSERT_NEAR(got[8 * i + a], expected.point[a] - cell[a] - 0.5, 4e-6 + expected.slack) << "sample " << i;
            ASSERT_NEAR(got[8 * i + 5 + a], 1, 2e-7); // weights that add up to 1
        }
        ASSERT_EQ(texels[4 * i], kNone);
    }
    EXPECT_LT(skipped, in_cells.size() * kSamples / 100);
}

TEST(kernel_surface, sample_surface_finds_the_four_texels_around_a_point)
{
    Triangle t;
    t.corners = {{{0, 0, 0.5}, {8, 0, 0.5}, {0, 8, 0.5}}};
    t.uv = {{{-3, -3}, {5, -3}, {-3, 5}}}; // one repetition a voxel, from (-3, -3) on
    t.color = {{{1, 0.5, 0}, {1, 0.5, 0.25}, {1, 0.5, 0.5}}};
    t.material = 1;
    KernelCase k(test_device());
    std::vector<int32_t> cells;
    std::vector<uint32_t> values, starts = {0};
    std::vector<float> sums;
    for (int32_t key = 0; key < 512; ++key) {
        const auto c = cell_of(uint32_t(key));
        if (c[2] == 0 && c[0] + c[1] < 7) {
            cells.insert(cells.end(), {c[0], c[1], c[2], key});
            values.push_back(0);
            sums.push_back(1);
        }
        starts.push_back(uint32_t(values.size()));
    }
    const SurfaceSamples y = sample_surface(k.graph, surface_in(k, {t}), k.input(values), k.input(sums),
                                            k.input(starts), k.input(cells, 4), 40, 1);
    const Tensor points = kept(k, y.points), addresses = kept(k, y.addresses);
    ASSERT_TRUE(k.compile_and_run());
    const auto got = k.read_array<float>(points);
    const auto texels = k.read_array<uint32_t>(addresses);
    for (size_t i = 0; i < texels.size() / 4; ++i) {
        const int32_t* c = &cells[i / 40 * 4];
        const double x = got[8 * i] + 0.5 + c[0], yy = got[8 * i + 1] + 0.5 + c[1];
        const double u = x - 3, v = yy - 3, v2 = v - 2 * std::floor(v / 2);
        const double column = (u - std::floor(u)) * 5 - 0.5, row = (v2 > 1 ? 2 - v2 : v2) * 3 - 0.5; // mirrored
        if (std::abs(column - std::round(column)) < 1e-4 || std::abs(row - std::round(row)) < 1e-4)
            continue;
        const int x0 = int(std::floor(column)), y0 = int(std::floor(row));
        const auto at = [&](int cx, int cy) {
            return 7 + std::clamp(cy, 0, 2) * 5 + (cx + 5) % 5; // rows end where they are mirrored
        };
        ASSERT_EQ(int(texels[4 * i]), at(x0, y0)) << i;
        ASSERT_EQ(int(texels[4 * i + 1]), at(x0 + 1, y0)) << i;
        ASSERT_EQ(int(texels[4 * i + 2]), at(x0, y0 + 1)) << i;
        ASSERT_EQ(int(texels[4 * i + 3]), at(x0 + 1, y0 + 1)) << i;
        ASSERT_NEAR(got[8 * i + 3], column - x0, 1e-4);
        ASSERT_NEAR(got[8 * i + 4], row - y0, 1e-4);
        ASSERT_NEAR(got[8 * i + 5], 0.5, 1e-6); // factor times vertex colour
        ASSERT_NEAR(got[8 * i + 6], 0.5, 1e-6);
        ASSERT_NEAR(got[8 * i + 7], 0.2 * (x / 8 * 0.25 + yy / 8 * 0.5), 1e-5);
    }
}

TEST(kernel_surface, gather_texels_takes_from_each_page_what_it_holds)
{
    KernelCase k(test_device());
    std::vector<uint32_t> low(1000), high(37), addresses = k.indices(5001, 1100);
    for (uint32_t i = 0; i < low.size(); ++i)
        low[i] = 3 * i;
    for (uint32_t i = 0; i < high.size(); ++i)
        high[i] = 3 * (1000 + i);
    addresses[17] = kNone;
    std::vector<uint32_t> before(addresses.size(), 77);
    const Tensor y = k.input(before), from = k.input(addresses);
    gather_texels(k.graph, from, k.input(low), 0, y);
    gather_texels(k.graph, from, k.input(high), 1000, y, k.input(std::vector<uint32_t>{4000}));
    ASSERT_TRUE(k.compile_and_run());
    const auto got = k.read_array<uint32_t>(y);
    for (size_t i = 0; i < got.size(); ++i)
        ASSERT_EQ(got[i], addresses[i] < (i < 4000 ? 1037u : 1000u) ? 3 * addresses[i] : 77u) << i;
}

double decoded(double v)
{
    return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

TEST(kernel_surface, surface_color_is_bilinear_in_linear_light_and_nearest_in_srgb)
{
    for (const uint32_t size : {1u, 64u, 4097u}) {
        KernelCase k(test_device());
        std::mt19937 random(2);
        std::vector<float> samples(size * 8), linear;
        std::vector<uint32_t> texels(size * 4);
        for (float& v : samples)
            v = float(random() % 65536) / 65536;
        for (uint32_t& t : texels)
            t = uint32_t(random() & 0xffffff);
        for (int i = 0; i < 512; ++i)
            linear.push_back(float(decoded((i < 256 ? i : i - 256 + 0.5) / 255)));
        const SurfaceSamples in{k.input(samples, 8), {}};
        const Tensor y = kept(k, surface_color(k.graph, in, k.input(texels, 4), k.input(linear)));
        ASSERT_TRUE(k.compile_and_run());
        const auto got = k.read_array<uint32_t>(y);
        for (uint32_t i = 0; i < size; ++i) {
            const float* s = &samples[8 * i];
            for (uint32_t a = 0; a < 3; ++a) {
                ASSERT_EQ(got[4 * i + a], std::bit_cast<uint32_t>(s[a]));
                double t[4];
                for (uint32_t q = 0; q < 4; ++q)
                    t[q] = decoded((texels[4 * i + q] >> (8 * a) & 255) / 255.0);
                const double value =
                    ((t[0] * (1 - s[3]) + t[1] * s[3]) * (1 - s[4]) + (t[2] * (1 - s[3]) + t[3] * s[3]) * s[4]) *
                    s[5 + a];
                const double srgb =
                    255 * (value <= 0.0031308 ? value * 12.92 : 1.055 * std::pow(value, 1 / 2.4) - 0.055);
                ASSERT_NEAR(got[4 * i + 3] >> (8 * a) & 255, srgb, 0.501) << "sample " << i;
            }
        }
    }
}

TEST(kernel_surface, surface_distance_matches_all_triangles_in_double)
{
    for (const auto& [count, extent] : {std::pair{1u, 2.0}, {5u, 0.5}, {700u, 0.3}, {200u, 6.0}}) {
        std::vector<Triangle> list = random_triangles(count, extent, 12);
        list[0].corners[1] = list[0].corners[0]; // one that is a line
        std::vector<std::array<float, 3>> positions;
        std::vector<std::array<uint32_t, 3>> faces;
        for (const Triangle& t : list) {
            const auto first = uint32_t(positions.size());
            faces.push_back({first, first + 1, first + 2});
            for (const auto& c : t.corners)
                positions.push_back({float(c[0]), float(c[1]), float(c[2])});
        }
        KernelCase k(test_device());
        const Bvh tree = build_bvh(positions, faces);
        std::vector<uint32_t> nodes, triangles;
        for (const auto& node : tree.nodes)
            nodes.insert(nodes.end(), node.begin(), node.end());
        for (const uint32_t face : tree.order) {
            for (const uint32_t v : faces[face])
                for (const float x : positions[v])
                    triangles.push_back(std::bit_cast<uint32_t>(x));
            triangles.push_back(face);
        }
        std::vector<float> points;
        std::mt19937 random(4);
        std::uniform_real_distribution<float> place(-8, 16);
        for (int i = 0; i < 3 * 501; ++i)
            points.push_back(place(random));
        std::vector<uint32_t> held;
        for (int i = 0; i < 501; ++i)
            held.insert(held.end(), {bits_of(6.5), kNone});
        const Tensor y = k.input(held, 2);
        surface_distance(k.graph, k.input(points, 3), {k.input(nodes, 16), k.input(triangles, 10)}, y);
        ASSERT_TRUE(k.compile_and_run());
        const auto got = k.read_array<uint32_t>(y);
        ASSERT_EQ(got.size(), 1002u);
        for (size_t i = 0; i < got.size() / 2; ++i) {
            double best = 6.5; // what y held
            for (const Triangle& t : list)
                best =
                    std::min(best, triangle_distance({points[3 * i], points[3 * i + 1], points[3 * i + 2]}, t.corners));
            ASSERT_NEAR(std::bit_cast<float>(got[2 * i]), best, 2e-5) << "point " << i;
            if (got[2 * i + 1] == kNone) {
                ASSERT_GT(best, 6.5 - 2e-5);
            } else {
                const Point3d p = {points[3 * i], points[3 * i + 1], points[3 * i + 2]};
                ASSERT_NEAR(triangle_distance(p, list.at(got[2 * i + 1]).corners), best, 2e-5) << "face of point " << i;
            }
        }
    }
}

} // namespace kernel_surface_test
} // namespace semrover
