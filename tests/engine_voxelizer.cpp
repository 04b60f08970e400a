// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/mesh/voxelizer.h"

#include "engine/mesh/chamfer.h"
#include "engine/mesh/surface_blocks.h"
#include "tests/support/clip_reference.h"
#include "tests/support/kernel_case.h"
#include "tests/support/says.h"

#include <algorithm>
#include <map>
#include <set>

namespace semrover {
namespace engine_voxelizer_test {

using Corner = std::array<float, 3>;

void add_quad(Mesh& m, const Corner& o, const Corner& a, const Corner& b)
{
    const auto first = uint32_t(m.positions.size());
    for (const auto& [s, t] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}})
        m.positions.push_back({o[0] + float(s) * a[0] + float(t) * b[0], o[1] + float(s) * a[1] + float(t) * b[1],
                               o[2] + float(s) * a[2] + float(t) * b[2]});
    m.faces.push_back({first, first + 1, first + 2});
    m.faces.push_back({first, first + 2, first + 3});
}

// a road, a wall and a ball, about `at`
Mesh street(const Corner& at, uint32_t seed)
{
    Mesh m;
    add_quad(m, {at[0] - 2.1f, at[1] - 1.9f, at[2]}, {4.3f, 0, 0.2f}, {0, 3.9f, -0.1f});
    add_quad(m, {at[0] - 2.1f, at[1] + 1.95f, at[2]}, {4.1f, 0.1f, 0}, {0.15f, 0.05f, 2.7f});
    const auto first = uint32_t(m.positions.size());
    std::mt19937 random(seed);
    for (int i = 0; i < 60; ++i) {
        const double u = double(random() % 1000) / 1000 * 6.28, v = double(random() % 1000) / 1000 * 3.14;
        m.positions.push_back({at[0] + float(std::cos(u) * std::sin(v)), at[1] + float(std::sin(u) * std::sin(v)),
                               at[2] + 1 + float(std::cos(v))});
    }
    for (uint32_t i = 0; i < 40; ++i)
        m.faces.push_back({first + uint32_t(random() % 60), first + uint32_t(random() % 60),
                           first + uint32_t(random() % 60)}); // some of them are degenerate
    return m;
}

std::array<Point3d, 3> corners_of(const Mesh& m, size_t face)
{
    std::array<Point3d, 3> t;
    for (size_t c = 0; c < 3; ++c)
        for (size_t a = 0; a < 3; ++a)
            t[c][a] = m.positions[m.faces[face][c]][a];
    return t;
}

std::map<Cell, double> cells_of(const Mesh& m, double size)
{
    std::map<Cell, double> cells;
    for (size_t f = 0; f < m.faces.size(); ++f) {
        const auto t = corners_of(m, f);
        std::array<int, 3> low, high, c;
        for (size_t a = 0; a < 3; ++a) {
            low[a] = int(std::floor(std::min({t[0][a], t[1][a], t[2][a]}) / size));
            high[a] = int(std::floor(std::max({t[0][a], t[1][a], t[2][a]}) / size));
        }
        for (c[0] = low[0]; c[0] <= high[0]; ++c[0])
            for (c[1] = low[1]; c[1] <= high[1]; ++c[1])
                for (c[2] = low[2]; c[2] <= high[2]; ++c[2]) {
                    const double area = polygon_area(clipped(t, c, size));
                    if (area > 0)
                        cells[c] += area;
                }
    }
    return cells;
}

double mesh_area(const Mesh& m)
{
    double sum = 0;
    for (size_t f = 0; f < m.faces.size(); ++f)
        sum += face_area(m, f);
    return sum;
}

VoxelizedMesh voxelized(const Mesh& m, VoxelizeOptions o)
{
    if (o.default_label == kNoLabel && m.face_labels.empty())
        o.default_label = 0;
    auto v = voxelize(test_device(), m, o);
    EXPECT_TRUE(v) << v.error().message;
    if (v) {
        const Status good = check_grid(v->grid, "grid");
        EXPECT_TRUE(good) << good.error().message;
    }
    return v ? std::move(*v) : VoxelizedMesh{};
}

Point3d point_of(const VoxelGrid& g, size_t cell, size_t i)
{
    Point3d p;
    for (size_t a = 0; a < 3; ++a)
        p[a] = (g.cells[cell][a] + 0.5) * double(g.voxel_size) +
               half_to_float(g.points[(cell * size_t(g.points_per_voxel) + i) * 3 + a]);
    return p;
}

TEST(EngineVoxelizer, cells_and_areas_are_those_of_clipping_in_double)
{
    for (const auto& [at, size] : {std::pair{Corner{0.3f, 0.2f, 0.1f}, 0.6f},
                                   {Corner{1000.37f, -2000.71f, 30.3f}, 0.6f},
                                   {Corner{-5, 3, 2}, 0.17f},
                                   {Corner{0, 0, 0}, 5.f}}) {
        const Mesh m = street(at, 3);
        const VoxelizedMesh v = voxelized(m, {.voxel_size = size, .points_per_voxel = 1, .min_area = 0});
        const std::map<Cell, double> expected = cells_of(m, double(size));
        // positions are rounded to 2^-20 of a voxel, and seen from a voxel to 5e-7 of one: a few edges of a voxel's
        // length
        const double error = 2e-5 * double(size) * double(size);
        for (const auto& [cell, area] : expected) {
            const auto found = find_cell(v.grid, cell);
            ASSERT_TRUE(found || area < error) << fmt::format("({}, {}, {}) {}", cell[0], cell[1], cell[2], area);
            ASSERT_NEAR(found ? v.area[*found] : 0, area, error);
        }
        double sum = 0;
        for (size_t i = 0; i < v.area.size(); ++i) {
            sum += v.area[i];
            ASSERT_TRUE(expected.contains(v.grid.cells[i]) || v.area[i] < error);
        }
        EXPECT_NEAR(sum, mesh_area(m), 3e-6 * mesh_area(m)); // 0.6 um in edges of some 0.3 m
    }
}

TEST(EngineVoxelizer, points_lie_in_their_cell_on_the_surface_in_the_order_of_a_token)
{
    for (const Corner& at : {Corner{0, 0, 0}, Corner{1000.37f, -2000.71f, 30.3f}}) {
        const Mesh m = street(at, 4);
        const VoxelizedMesh v = voxelized(m, {.points_per_voxel = 20});
        const float half = v.grid.voxel_size / 2;
        for (size_t cell = 0; cell < v.grid.cells.size(); ++cell) {
            double last = 0;
            for (size_t i = 0; i < 20; ++i) {
                double d2 = 0;
                for (size_t a = 0; a < 3; ++a) {
                    const float x = half_to_float(v.grid.points[(cell * 20 + i) * 3 + a]);
                    ASSERT_LE(std::abs(x), half);
                    d2 += double(x) * x;
                }
                ASSERT_GE(d2, last);
                last = d2;
                double nearest = 1;
                for (size_t f = 0; f < m.faces.size(); ++f)
                    nearest = std::min(nearest, triangle_distance(point_of(v.grid, cell, i), corners_of(m, f)));
                // half precision rounds up to 0.3 m by 0.122 mm an axis, towards the voxel by twice that at its border
                ASSERT_LT(nearest, 1e-4 + 1.23e-4 * std::sqrt(3.0)) << "voxel " << cell << " point " << i;
            }
        }
    }
}

TEST(EngineVoxelizer, a_triangle_over_a_hundred_thousand_cells_fills_each_of_them)
{
    Mesh m;
    m.positions = {{0.03f, 0.04f, 0.05f}, {45.53f, 0.04f, 0.05f}, {0.03f, 45.54f, 0.05f}};
    m.faces = {{0, 1, 2}};
    const VoxelizedMesh v = voxelized(m, {.voxel_size = 0.1f, .points_per_voxel = 1, .min_area = 0});
    EXPECT_GT(v.grid.cells.size(), 100000u);
    double sum = 0;
    size_t whole = 0;
    for (size_t i = 0; i < v.area.size(); ++i) {
        sum += v.area[i];
        whole += std::abs(v.area[i] - 0.01) < 1e-7;
        ASSERT_LT(v.area[i], 0.01 + 1e-7);
        ASSERT_EQ(v.grid.cells[i][2], 0);
    }
    EXPECT_NEAR(sum, mesh_area(m), 1e-5 * sum);
    EXPECT_GT(whole, 102000u); // all but those at the three sides
}

TEST(EngineVoxelizer, a_surface_between_two_cells_counts_once_in_the_upper_one)
{
    Mesh m;
    add_quad(m, {0.1f, 0.1f, 0.5f}, {0.3f, 0, 0}, {0, 0.3f, 0}); // z = 0.5
    add_quad(m, {1.0f, 0.1f, 0.1f}, {0, 0.3f, 0}, {0, 0, 0.3f}); // x = 1
    add_quad(m, {2.1f, 0, 0.1f}, {0.3f, 0, 0}, {0, 0, 0.3f});    // y = 0
    const VoxelizedMesh v = voxelized(m, {.voxel_size = 0.5f, .points_per_voxel = 3, .min_area = 0});
    ASSERT_EQ(v.grid.cells, (std::vector<Cell>{{0, 0, 1}, {2, 0, 0}, {4, 0, 0}}));
    for (const float area : v.area)
        EXPECT_NEAR(area, 0.09, 1e-6);
}

TEST(EngineVoxelizer, points_are_uniform_over_the_area_of_a_cell)
{
    Mesh m; // a fan of unequal triangles over a square of one voxel and more
    m.positions = {{0.25f, 0.21f, 0.3f}, {-1, -1, 0.3f}, {2, -1, 0.3f}, {2, 2, 0.3f}, {-1, 2, 0.3f}};
    m.faces = {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 1}};
    const VoxelizedMesh v = voxelized(m, {.points_per_voxel = 4096, .seed = 11});
    const size_t cell = *find_cell(v.grid, {0, 0, 0});
    std::array<size_t, 64> bins{};
    for (size_t i = 0; i < 4096; ++i) {
        const Point3d p = point_of(v.grid, cell, i);
        const auto bin = [](double x) { return size_t(std::clamp(int(x / 0.6 * 8), 0, 7)); };
        ++bins[bin(p[0]) * 8 + bin(p[1])];
    }
    double chi2 = 0;
    for (const size_t count : bins)
        chi2 += std::pow(double(count) - 64, 2) / 64;
    EXPECT_LT(chi2, 63); // the mean for independent points; these are more even
}

// of many voxels, which are shifted independently
TEST(EngineVoxelizer, points_of_many_cells_are_uniform_over_the_area_of_a_cell)
{
    Mesh m;
    m.positions = {{0, 0, 0.3f}, {38.4f, 0, 0.3f}, {38.4f, 38.4f, 0.3f}, {0, 38.4f, 0.3f}};
    m.faces = {{0, 1, 2}, {0, 2, 3}};
    const VoxelizedMesh v = voxelized(m, {.points_per_voxel = 5, .seed = 3});
    ASSERT_EQ(v.grid.cells.size(), 4096u);
    std::array<size_t, 64> all{};
    for (size_t i = 0; i < 4096 * 5; ++i) {
        const Point3d p = point_of(v.grid, i / 5, i % 5);
        const auto at = [&](size_t a) {
            return size_t(std::clamp(p[a] / 0.6 - v.grid.cells[i / 5][a], 0.0, 0.999) * 8);
        };
        ++all[at(0) * 8 + at(1)];
    }
    double chi2 = 0;
    for (const size_t count : all)
        chi2 += std::pow(double(count) - 320, 2) / 320;
    EXPECT_LT(chi2, 63 + 4 * 11.2); // 63 degrees of freedom
}

std::vector<float> places(const VoxelGrid& g, const Cell& cell)
{
    std::vector<float> x;
    const size_t at = *find_cell(g, cell), values = size_t(g.points_per_voxel) * 3;
    for (size_t i = 0; i < values; ++i)
        x.push_back(half_to_float(g.points[at * values + i]));
    return x;
}

TEST(EngineVoxelizer, canonical_points_of_a_flat_cell_are_the_same_four_rows_of_five_however_it_is_cut)
{
    Mesh m; // a wall of two triangles, and one of many in front of a plane that nobody sees
    add_quad(m, {0, 0.9f, 0}, {6, 0, 0}, {0, 0, 6});
    add_quad(m, {0, 3.4f, 0}, {6, 0, 0}, {0, 0, 6});
    for (int i = 0; i < 7; ++i)
        add_quad(m, {float(i) * 0.857f, 3.3f, 0}, {0.857f, 0, 0}, {0, 0, 6});
    const VoxelizedMesh v = voxelized(m, {.placement = PointPlacement::canonical, .seed = 1}),
                        other = voxelized(m, {.placement = PointPlacement::canonical, .seed = 2});
    EXPECT_EQ(v.grid.points, other.grid.points);
    EXPECT_EQ(v.grid.metadata.at("placement"), "canonical");
    EXPECT_FALSE(voxelized(m, {}).grid.metadata.contains("placement"));
    std::set<std::pair<int, int>> texels;
    const std::vector<float> first = places(v.grid, {3, 1, 3});
    for (size_t i = 0; i < 20; ++i) {
        const double x = first[3 * i] / 0.6 + 0.5, z = first[3 * i + 2] / 0.6 + 0.5;
        EXPECT_NEAR(first[3 * i + 1], 0, 1e-4); // 0.9 is the middle of voxels of 0.6
        texels.insert({int(std::lround(z * 4 - 0.5)), int(std::lround(x * 5 - 0.5))});
        EXPECT_NEAR(z * 4 - 0.5, std::round(z * 4 - 0.5), 1e-2);
        EXPECT_NEAR(x * 5 - 0.5, std::round(x * 5 - 0.5), 1e-2);
    }
    EXPECT_EQ(texels.size(), 20u);
    for (int32_t i = 0; i < 9; ++i)
        EXPECT_EQ(places(v.grid, {i, 1, 4}), first) << i;
    for (int32_t i = 0; i < 9; ++i) {
        const std::vector<float> cut = places(v.grid, {i, 5, 2});
        for (size_t p = 0; p < 20; ++p) {
            EXPECT_NEAR(cut[3 * p], first[3 * p], 3e-4) << i;
            EXPECT_NEAR(cut[3 * p + 1], 0, 1e-3) << i; // at 3.3, not at 3.4
        }
    }
}

TEST(EngineVoxelizer, canonical_points_lie_on_the_surface_and_as_near_to_it_as_shifted_ones)
{
    const Mesh m = street({2.03f, 0.04f, 0.05f}, 8);
    const VoxelizedMesh v = voxelized(m, {.placement = PointPlacement::canonical});
    for (size_t cell = 0; cell < v.grid.cells.size(); ++cell)
        for (size_t i = 0; i < 20; ++i) {
            double nearest = 1;
            for (size_t f = 0; f < m.faces.size(); ++f)
                nearest = std::min(nearest, triangle_distance(point_of(v.grid, cell, i), corners_of(m, f)));
            ASSERT_LT(nearest, 1e-4 + 1.23e-4 * std::sqrt(3.0)) << "voxel " << cell << " point " << i;
        }
    Mesh walls;
    add_quad(walls, {0, 0.2f, 0.31f}, {12, 0, 0}, {0, 12, 0});
    add_quad(walls, {0, 12.2f, 0.31f}, {12, 0, 0}, {0, 0, 6});
    const auto mean = [&](PointPlacement placement) {
        return chamfer(test_device(), walls, measured_points(voxelized(walls, {.placement = placement}).grid),
                       {.samples = 20000})
            ->mean();
    };
    EXPECT_LT(mean(PointPlacement::canonical), 1.02 * mean(PointPlacement::shifted));
}

TEST(EngineVoxelizer, neither_the_order_of_faces_nor_the_size_of_portions_changes_a_byte)
{
    Mesh m = street({3, 1, 0}, 5);
    for (size_t f = 0; f < m.faces.size(); ++f)
        m.face_labels.push_back(uint8_t(f % 20));
    for (size_t i = 0; i < m.positions.size(); ++i)
        m.colors.push_back({uint8_t(i * 7), uint8_t(i * 31), uint8_t(i)});
    const VoxelizeOptions o{.voxel_size = 0.25f, .points_per_voxel = 7, .seed = 9};
    const VoxelizedMesh expected = voxelized(m, o);
    Mesh shuffled = m;
    std::mt19937 random(1);
    std::vector<size_t> order(m.faces.size());
    for (size_t i = 0; i < order.size(); ++i)
        order[i] = i;
    std::shuffle(order.begin(), order.end(), random);
    for (size_t i = 0; i < order.size(); ++i) {
        shuffled.faces[i] = m.faces[order[i]];
        std::rotate(shuffled.faces[i].begin(), shuffled.faces[i].begin() + ptrdiff_t(i % 3), shuffled.faces[i].end());
        shuffled.face_labels[i] = m.face_labels[order[i]];
    }
    VoxelizeOptions small = o;
    small.max_pairs = 60;
    for (const VoxelizedMesh& v : {voxelized(shuffled, o), voxelized(m, small)}) {
        EXPECT_EQ(v.grid.cells, expected.grid.cells);
        EXPECT_EQ(v.grid.labels, expected.grid.labels);
        EXPECT_EQ(v.grid.points, expected.grid.points);
        EXPECT_EQ(v.grid.colors, expected.grid.colors);
        EXPECT_EQ(v.area, expected.area);
    }
    VoxelizeOptions other = o;
    other.seed = 10;
    EXPECT_NE(voxelized(m, other).grid.points, expected.grid.points);
}

TEST(EngineVoxelizer, a_cell_has_the_label_of_its_largest_area_and_ties_go_to_the_lower)
{
    Mesh m;
    add_quad(m, {0, 0, 0.1f}, {0.5f, 0, 0}, {0, 0.5f, 0});
    add_quad(m, {0, 0, 0.2f}, {0.5f, 0, 0}, {0, 0.5f, 0});
    add_quad(m, {1, 0, 0.1f}, {0.5f, 0, 0}, {0, 0.25f, 0});
    add_quad(m, {1, 0, 0.2f}, {0.5f, 0, 0}, {0, 0.5f, 0});
    m.face_labels = {8, 8, 2, 2, 1, 1, 17, 17};
    const VoxelizedMesh v = voxelized(m, {.voxel_size = 0.5f, .points_per_voxel = 1});
    EXPECT_EQ(v.grid.labels[*find_cell(v.grid, {0, 0, 0})], 2);
    EXPECT_EQ(v.grid.labels[*find_cell(v.grid, {2, 0, 0})], 17);
}

TEST(EngineVoxelizer, colours_are_bilinear_texels_times_material_in_linear_light)
{
    Mesh m; // u and v run once over 4 m; the texture is a ramp along u, the same everywhere along v
    add_quad(m, {0, 0, 0.3f}, {4, 0, 0}, {0, 4, 0});
    m.uvs = {{{{0, 0}, {1, 0}, {1, 1}}}, {{{0, 0}, {1, 1}, {0, 1}}}};
    m.face_materials = {0, 0};
    m.materials = {{"road", {1, 0.5f, 0.25f}, 0}};
    Texture ramp{{16, 2, {}}, TextureWrap::clamp, TextureWrap::mirror};
    for (int i = 0; i < 32; ++i)
        ramp.image.pixels.insert(ramp.image.pixels.end(), {uint8_t(i % 16 * 16), uint8_t(i % 16 * 16), 200});
    m.textures = {ramp};
    const VoxelizedMesh v = voxelized(m, {.points_per_voxel = 8});
    const auto decoded = [](double x) { return x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4); };
    const auto encoded = [](double x) {
        return 255 * (x <= 0.0031308 ? x * 12.92 : 1.055 * std::pow(x, 1 / 2.4) - 0.055);
    };
    for (size_t cell = 0; cell < v.grid.cells.size(); ++cell)
        for (size_t i = 0; i < 8; ++i) {
            const double x = std::clamp(point_of(v.grid, cell, i)[0] / 4 * 16 - 0.5, 0.0, 15.0), x0 = std::floor(x);
            const double at =
                decoded(x0 * 16 / 255) * (1 - x + x0) + decoded(std::min(x0 + 1, 15.0) * 16 / 255) * (x - x0);
            const uint8_t* c = &v.grid.colors[(cell * 8 + i) * 3];
            // 0.2 mm of the stored point are 0.0008 texels; a texel is 16 levels, steeper near black
            ASSERT_NEAR(c[0], encoded(at), 0.6);
            ASSERT_NEAR(c[1], encoded(at * 0.5), 0.6);
            ASSERT_NEAR(c[2], encoded(decoded(200 / 255.0) * 0.25), 0.51);
        }
}

TEST(EngineVoxelizer, vertex_colours_are_interpolated_in_linear_light)
{
    Mesh m;
    add_quad(m, {0, 0, 0.3f}, {0.6f, 0, 0}, {0, 0.6f, 0});
    m.colors = {{255, 0, 7}, {255, 255, 7}, {255, 255, 7}, {255, 0, 7}};
    const VoxelizedMesh v = voxelized(m, {.points_per_voxel = 100});
    const size_t cell = *find_cell(v.grid, {0, 0, 0});
    for (size_t i = 0; i < 100; ++i) {
        const double x = point_of(v.grid, cell, i)[0] / 0.6;
        const uint8_t* c = &v.grid.colors[(cell * 100 + i) * 3];
        ASSERT_EQ(c[0], 255);
        ASSERT_NEAR(c[1], 255 * (x <= 0.0031308 ? x * 12.92 : 1.055 * std::pow(x, 1 / 2.4) - 0.055), 1.5);
        ASSERT_EQ(c[2], 7);
    }
}

// 12 m of checks of 0.4 m, of which every second one is transparent and black
Mesh checks(float cutoff)
{
    Mesh m;
    add_quad(m, {0, 0, 0.31f}, {12, 0, 0}, {0, 12, 0});
    m.uvs = {{{{0, 0}, {1, 0}, {1, 1}}}, {{{0, 0}, {1, 1}, {0, 1}}}};
    m.face_materials = {0, 0};
    m.materials = {{.name = "leaves", .texture = 0, .alpha_cutoff = cutoff, .alpha_texture = 0}};
    Texture t{{30, 30, {}}, TextureWrap::clamp, TextureWrap::clamp};
    for (int i = 0; i < 900; ++i) {
        const bool opaque = (i / 30 + i % 30) % 2 == 0;
        t.image.pixels.insert(t.image.pixels.end(), {0, uint8_t(opaque ? 255 : 0), 0});
        t.alpha.push_back(opaque ? 200 : 100);
    }
    m.textures = {t};
    return m;
}

TEST(EngineVoxelizer, no_point_lies_where_alpha_makes_no_surface_and_its_area_does_not_count)
{
    for (const PointPlacement placement : {PointPlacement::shifted, PointPlacement::canonical}) {
        const VoxelizedMesh v = voxelized(checks(0.5f), {.placement = placement});
        ASSERT_EQ(v.grid.cells.size(), 400u);
        double sum = 0;
        for (size_t cell = 0; cell < 400; ++cell) {
            sum += v.area[cell];
            for (size_t i = 0; i < 20; ++i) {
                const Point3d p = point_of(v.grid, cell, i);
                // to the millimetre that half precision may move a point over an edge
                const auto near_edge = [](double x) { return std::abs(x / 0.4 - std::round(x / 0.4)) < 0.0025; };
                const bool opaque = (int(p[0] / 0.4) + int(p[1] / 0.4)) % 2 == 0;
                ASSERT_TRUE(opaque || near_edge(p[0]) || near_edge(p[1])) << p[0] << " " << p[1];
                ASSERT_EQ(v.grid.colors[(cell * 20 + i) * 3 + 1], 255); // transparent texels do not darken it
            }
        }
        EXPECT_NEAR(sum, 72, 1.5); // of 144; areas are measured at 64 places of a triangle in a voxel
    }
    const VoxelizedMesh opaque = voxelized(checks(0.3f), {}), all = voxelized(checks(0), {});
    EXPECT_EQ(opaque.grid.points, all.grid.points);
    EXPECT_EQ(opaque.area, all.area);
    EXPECT_TRUE(says(voxelize(test_device(), checks(0.9f), {.default_label = 0}), "has no surface"));
}

TEST(EngineVoxelizer, what_is_transparent_does_not_vote_for_a_label)
{
    Mesh m; // leaves that are three quarters transparent over half as much wall
    add_quad(m, {0, 0, 0.1f}, {0.6f, 0, 0}, {0, 0.6f, 0});
    add_quad(m, {0, 0, 0.2f}, {0.6f, 0, 0}, {0, 0.3f, 0});
    m.uvs = {{{{0, 0}, {1, 0}, {1, 1}}}, {{{0, 0}, {1, 1}, {0, 1}}}, {}, {}};
    m.face_labels = {8, 8, 3, 3};
    m.face_materials = {0, 0, 1, 1};
    m.materials = {{.name = "leaves", .alpha_cutoff = 0.5f, .alpha_texture = 0}, {.name = "wall"}};
    m.textures = {{{4, 1, std::vector<uint8_t>(12, 99)}, TextureWrap::clamp, TextureWrap::clamp, {255, 0, 0, 0}}};
    const VoxelizedMesh v = voxelized(m, {});
    ASSERT_EQ(v.grid.labels, std::vector<uint8_t>{3});
    EXPECT_NEAR(v.area[0], 0.18 + 0.09, 0.01);
    m.materials[0].alpha_cutoff = 0;
    EXPECT_EQ(voxelized(m, {}).grid.labels, std::vector<uint8_t>{8});
    // alpha of vertices: it falls from 1 to 0 along x
    Mesh fading;
    add_quad(fading, {0, 0, 0.1f}, {6, 0, 0}, {0, 0.6f, 0});
    fading.alphas = {255, 0, 0, 255};
    fading.face_materials = {0, 0};
    fading.materials = {{.name = "fog", .alpha_cutoff = 0.45f}};
    const VoxelizedMesh faded = voxelized(fading, {});
    for (size_t cell = 0; cell < faded.grid.cells.size(); ++cell)
        for (size_t i = 0; i < 20; ++i)
            ASSERT_LT(point_of(faded.grid, cell, i)[0], 3.32); // alpha has 256 steps
    EXPECT_EQ(faded.grid.cells.size(), 6u);
}

TEST(EngineVoxelizer, a_mesh_far_from_the_origin_gets_the_cells_and_points_of_its_place)
{
    Mesh near;
    add_quad(near, {0.1f, 0.3f, 0}, {5.9f, 0, 0}, {0, 0, 3});
    Mesh far = near;
    far.origin = {530000.4, -180000.25, 12};
    const VoxelizedMesh v = voxelized(far, {});
    double low = 1e9, high = -1e9;
    for (size_t cell = 0; cell < v.grid.cells.size(); ++cell)
        for (size_t i = 0; i < 20; ++i) {
            std::array<double, 3> p; // the voxel size in decimals, as the file says it
            for (size_t a = 0; a < 3; ++a)
                p[a] = (v.grid.cells[cell][a] + 0.5) * 0.6 + half_to_float(v.grid.points[(cell * 20 + i) * 3 + a]);
            ASSERT_NEAR(p[1], -179999.95, 1e-3);
            low = std::min(low, p[0]);
            high = std::max(high, p[0]);
        }
    EXPECT_NEAR(low, 530000.5, 0.05);
    EXPECT_NEAR(high, 530006.4, 0.05);
    const auto c =
        chamfer(test_device(), far, measured_points(v.grid, cell_edge(far, v.grid.voxel_size)), {.samples = 20000});
    ASSERT_TRUE(c);
    EXPECT_LT(c->to_surface, 1e-3);
    EXPECT_LT(c->to_points, 0.1);
    far.origin = {500123, 4649000, 0};
    EXPECT_TRUE(says(voxelize(test_device(), far, {.default_label = 0}),
                     "beyond 2^20 voxels of 0.6 m; move it to the origin (`origin`), or take a larger voxel size"));
}

TEST(EngineVoxelizer, label_textures_say_labels_where_faces_do_not)
{
    Mesh m;
    add_quad(m, {0, 0, 0.3f}, {1.2f, 0, 0}, {0, 0.6f, 0});
    m.uvs = {{{{0, 0}, {1, 0}, {1, 1}}}, {{{0, 0}, {1, 1}, {0, 1}}}};
    m.face_materials = {0, 0};
    m.materials = {{"", {1, 1, 1}, -1, 0}};
    m.textures = {{{2, 1, {70, 70, 70, 13, 13, 13}}, TextureWrap::clamp, TextureWrap::clamp}};
    const VoxelizeOptions o{.points_per_voxel = 1, .min_area = 0.01f};
    const auto v = voxelize(test_device(), m, o);
    ASSERT_TRUE(v) << v.error().message;
    EXPECT_EQ(v->grid.cells, (std::vector<Cell>{{0, 0, 0}, {1, 0, 0}}));
    EXPECT_EQ(v->grid.labels, (std::vector<uint8_t>{2, 13})); // building's colour, then a number
    m.textures[0].image.pixels = {70, 70, 70, 99, 1, 2};
    EXPECT_TRUE(says(voxelize(test_device(), m, o), "pixels of label textures have no label (0.36"));
    VoxelizeOptions with_default = o;
    with_default.default_label = 9;
    const auto filled = voxelize(test_device(), m, with_default);
    ASSERT_TRUE(filled);
    EXPECT_EQ(filled->grid.labels, (std::vector<uint8_t>{2, 9}));
}

TEST(EngineVoxelizer, what_cannot_be_voxelized_is_one_line)
{
    Device& d = test_device();
    const VoxelizeOptions good{.default_label = 0};
    Mesh m = street({0, 0, 0}, 1);
    EXPECT_TRUE(says(voxelize(d, m, {}), "44 of 44 faces have no label ("));
    for (const auto& [change, text] :
         std::initializer_list<std::pair<std::function<void(VoxelizeOptions&)>, const char*>>{
             {[](auto& o) { o.voxel_size = 0; }, "voxel size of 0.001 to 1000 m, found 0"},
             {[](auto& o) { o.voxel_size = NAN; }, "found nan"},
             {[](auto& o) { o.points_per_voxel = 0; }, "1 to 4096 points"},
             {[](auto& o) { o.min_area = -1; }, "least area"},
             {[](auto& o) { o.default_label = 20; }, "default label of 0 to 19, found 20"}}) {
        VoxelizeOptions o = good;
        change(o);
        EXPECT_TRUE(says(voxelize(d, m, o), text));
    }
    m.positions[3][1] = NAN;
    EXPECT_TRUE(says(voxelize(d, m, good), "vertex 3"));
    Mesh line;
    line.positions = {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}};
    line.faces = {{0, 1, 2}, {1, 1, 1}};
    EXPECT_TRUE(says(voxelize(d, line, good), "no surface"));
    Mesh far;
    far.positions = {{9e5f, 0, 0}, {9e5f, 1, 0}, {9e5f, 0, 1}};
    far.faces = {{0, 1, 2}};
    EXPECT_TRUE(says(voxelize(d, far, good), "beyond 2^20 voxels"));
    Mesh wide;
    wide.positions = {{-3e5f, -3e5f, 0}, {3e5f, -3e5f, 0}, {0, 3e5f, 0}};
    wide.faces = {{0, 1, 2}};
    EXPECT_TRUE(says(voxelize(d, wide, good), "take a larger voxel size"));
    EXPECT_TRUE(says(voxelize(d, Mesh{}, good), "no faces"));
}

TEST(EngineVoxelizer, chamfer_is_the_mean_of_both_distances)
{
    const Mesh m = street({2, 0, 0}, 8);
    const VoxelizedMesh v = voxelized(m, {.points_per_voxel = 5});
    VoxelGrid moved = v.grid; // so that distances to the surface are not all nearly 0
    for (size_t i = 2; i < moved.points.size(); i += 3)
        moved.points[i] = float_to_half(std::clamp(half_to_float(moved.points[i]) + 0.1f, -0.3f, 0.3f));
    const auto c = chamfer(test_device(), m, measured_points(moved), {.samples = 20000});
    ASSERT_TRUE(c) << c.error().message;
    double to_surface = 0;
    for (size_t cell = 0; cell < moved.cells.size(); ++cell)
        for (size_t i = 0; i < 5; ++i) {
            double nearest = 1e9;
            for (size_t f = 0; f < m.faces.size(); ++f)
                nearest = std::min(nearest, triangle_distance(point_of(moved, cell, i), corners_of(m, f)));
            to_surface += nearest / double(moved.cells.size() * 5);
        }
    EXPECT_NEAR(c->to_surface, to_surface, 1e-5);
    EXPECT_DOUBLE_EQ(c->mean(), (c->to_surface + c->to_points) / 2);
}

TEST(EngineVoxelizer, chamfer_of_a_plane_is_that_of_points_strewn_over_it_and_falls_with_their_number)
{
    Mesh m;
    add_quad(m, {0, 0, 0.31f}, {12, 0, 0}, {0, 12, 0});
    double last = 1;
    for (const int n : {2, 8, 20}) {
        const VoxelizedMesh v = voxelized(m, {.points_per_voxel = n});
        const auto c = chamfer(test_device(), m, measured_points(v.grid), {.samples = 20000, .seed = 3});
        ASSERT_TRUE(c) << c.error().message;
        EXPECT_LT(c->to_surface, 2e-4); // half precision
        // mean distance to the nearest point at density d: 0.5 / sqrt(d) of independent ones (Poisson), 0.377 / sqrt(d)
        // of the best there are (a hexagonal lattice)
        const double spacing = std::sqrt(0.36 / n);
        EXPECT_LT(c->to_points, 0.9 * 0.5 * spacing);
        EXPECT_GT(c->to_points, 0.377 * spacing);
        EXPECT_LT(c->mean(), last);
        last = c->mean();
    }
    VoxelGrid empty;
    EXPECT_TRUE(says(chamfer(test_device(), m, measured_points(empty)), "no points"));
}

} // namespace engine_voxelizer_test
} // namespace semrover
