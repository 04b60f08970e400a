// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/fusion/surface_error.h"
#include "tests/support/kernel_case.h"
#include "tests/support/says.h"

#include <algorithm>
#include <cmath>

namespace semrover {
namespace engine_surface_error_test {

using Vec = std::array<double, 3>;

Vec minus(const Vec& a, const Vec& b)
{
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
double dot(const Vec& a, const Vec& b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Vec cross(const Vec& a, const Vec& b)
{
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double to_segment(const Vec& p, const Vec& a, const Vec& b)
{
    const Vec d = minus(b, a), e = minus(p, a);
    const double t = dot(d, d) > 0 ? std::clamp(dot(e, d) / dot(d, d), 0.0, 1.0) : 0;
    const Vec off = {e[0] - t * d[0], e[1] - t * d[1], e[2] - t * d[2]};
    return std::sqrt(dot(off, off));
}

// the distance to the plane where the foot lies inside, else to the nearest side
double to_triangle(const Vec& p, const Vec& a, const Vec& b, const Vec& c)
{
    const Vec n = cross(minus(b, a), minus(c, a));
    bool inside = dot(n, n) > 0;
    for (const auto& [from, to] : {std::pair{&a, &b}, {&b, &c}, {&c, &a}})
        inside = inside && dot(cross(minus(*to, *from), minus(p, *from)), n) >= 0;
    if (inside)
        return std::abs(dot(n, minus(p, a))) / std::sqrt(dot(n, n));
    return std::min({to_segment(p, a, b), to_segment(p, b, c), to_segment(p, c, a)});
}

struct NearestCase {
    uint32_t faces, points;
    double spread, size, radius; // metres: of all, of a triangle
};

Mesh random_mesh(const NearestCase& c, std::mt19937& random)
{
    const auto uniform = [&](double half) { return float((double(random() % 65536) / 32768 - 1) * half); };
    Mesh mesh;
    for (uint32_t f = 0; f < c.faces; ++f) {
        const std::array<float, 3> at = {uniform(c.spread), uniform(c.spread), uniform(c.spread / 4)};
        for (uint32_t corner = 0; corner < 3; ++corner)
            mesh.positions.push_back({at[0] + uniform(c.size), at[1] + uniform(c.size), at[2] + uniform(c.size)});
        if (f % 7 == 3)
            mesh.positions.back() = mesh.positions[3 * f]; // no area
        mesh.faces.push_back({3 * f, 3 * f + 1, 3 * f + 2});
        mesh.face_labels.push_back(uint8_t(f % 20));
    }
    return mesh;
}

TEST(engine_surface_error, distances_match_all_triangles_one_by_one)
{
    // one triangle; small ones; ones much longer than a voxel; points far outside; a radius
    for (const NearestCase& c :
         {NearestCase{1, 50, 0, 1, 100}, NearestCase{300, 700, 4, 0.3, 100}, NearestCase{60, 500, 6, 9, 100},
          NearestCase{40, 301, 2, 0.2, 1000}, NearestCase{200, 700, 8, 0.3, 0.7}}) {
        SCOPED_TRACE(fmt::format("{} triangles of {} m", c.faces, c.size));
        std::mt19937 random(5);
        const Mesh truth = random_mesh(c, random);
        Mesh mesh;
        for (uint32_t i = 0; i < c.points; ++i) {
            const double reach = c.radius == 1000 ? 60 : c.spread * 1.2 + 1;
            const auto uniform = [&] { return float((double(random() % 65536) / 32768 - 1) * reach); };
            mesh.positions.push_back({uniform(), uniform(), uniform()});
        }
        const auto error = measure_surface(test_device(), mesh, truth, {}, 0, c.radius);
        ASSERT_TRUE(error) << error.error().message;
        size_t beyond = 0;
        for (uint32_t i = 0; i < c.points; ++i) {
            double expect = c.radius;
            const auto vec = [](const std::array<float, 3>& v) { return Vec{v[0], v[1], v[2]}; };
            for (const auto& f : truth.faces)
                expect = std::min(expect, to_triangle(vec(mesh.positions[i]), vec(truth.positions[f[0]]),
                                                      vec(truth.positions[f[1]]), vec(truth.positions[f[2]])));
            beyond += expect == c.radius;
            ASSERT_NEAR(error->distances[i], expect, 2e-5 * (1 + c.spread + c.size)) << i;
        }
        EXPECT_EQ(error->beyond, beyond);
    }
}

TEST(engine_surface_error, labels_of_faces_are_compared_by_area_where_enough_frames_saw_all_corners)
{
    Mesh truth;
    truth.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
    truth.faces = {{0, 1, 2}, {1, 3, 2}, {4, 5, 6}};
    truth.face_labels = {0, 0, 13};
    Mesh mesh;
    mesh.positions = {{0.1f, 0.1f, 0.1f}, {0.6f, 0.1f, 0.2f}, {0.1f, 0.6f, 0.1f}, {0.1f, 0.1f, 0.9f}};
    mesh.faces = {{0, 1, 2}, {0, 1, 3}, {0, 2, 3}};
    mesh.face_labels = {0, 13, 0};
    const auto all = measure_surface(test_device(), mesh, truth);
    ASSERT_TRUE(all) << all.error().message;
    const double first = 0.5 * std::hypot(0.05, 0.25); // areas: first, 0.2, 0.2; all middles are nearest to the ground
    EXPECT_NEAR(all->labelled, first + 0.4, 1e-6);
    EXPECT_NEAR(all->right, first + 0.2, 1e-6);
    EXPECT_NEAR(all->confusion[0][13], 0.2, 1e-6);
    EXPECT_NEAR(all->percentile(1), 0.2, 1e-6);
    EXPECT_NEAR(all->percentile(0), 0.1, 1e-6);
    const auto seen = measure_surface(test_device(), mesh, truth, {2, 1, 3, 5});
    ASSERT_TRUE(seen) << seen.error().message;
    EXPECT_EQ(seen->distances.size(), 3u);
    EXPECT_NEAR(seen->labelled, 0.2, 1e-6); // the face of 0, 2 and 3
    EXPECT_NEAR(seen->right, 0.2, 1e-6);
    EXPECT_TRUE(says(measure_surface(test_device(), mesh, truth, {1, 1, 0, 1}), "none of 4 vertices was seen by 2"));
}

TEST(engine_surface_error, views_are_counted_where_the_depth_agrees)
{
    Mesh mesh;
    mesh.positions = {{0, 0, 5}, {0, 0, 4}, {0, 0, -5}, {4, 0, 5}, {9, 0, 5}, {0, 0, 5.05f}};
    CameraFrame camera;
    camera.intrinsics = {50, 50, 50, 40, 100, 80};
    DepthFrames frames{{camera, camera}, [](size_t i) -> Result<DepthImages> {
                           DepthImages images;
                           images.depth.assign(100 * 80, i == 0 ? 5.f : 0.f);
                           return images;
                       }};
    const auto views = count_views(mesh, frames);
    ASSERT_TRUE(views) << views.error().message;
    EXPECT_EQ(*views, (std::vector<uint32_t>{1, 0, 0, 1, 0, 1}));
}

} // namespace engine_surface_error_test
} // namespace semrover
