// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "kernels/trace.h"
#include "tests/support/splat_case.h"
#include "tools/streets/street.h"
#include "tools/trace/trace_scene.h"

#include <bit>
#include <cmath>

namespace semrover {
namespace kernel_trace_rays_test {

using semrover::cross;
using semrover::dot;

using Vec = std::array<double, 3>;

Vec minus(const Vec& a, const Vec& b)
{
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
struct RayCase {
    std::array<float, 3> origin;
    float near;
    std::array<float, 3> direction;
    float far;
};

// where a ray meets a triangle's plane, and by how much it is inside: below 0 outside, in weights of corners
struct Meeting {
    double t = 0, inside = -1;
};
Meeting meet(const Mesh& m, size_t face, const RayCase& ray)
{
    const auto at = [&](size_t c) {
        const auto& p = m.positions[m.faces[face][c]];
        return Vec{p[0], p[1], p[2]};
    };
    const Vec o = {ray.origin[0], ray.origin[1], ray.origin[2]},
              d = {ray.direction[0], ray.direction[1], ray.direction[2]};
    const Vec a = at(0), e1 = minus(at(1), a), e2 = minus(at(2), a), p = cross(d, e2);
    const double det = dot(e1, p);
    if (std::abs(det) < 1e-12)
        return {};
    const Vec s = minus(o, a), q = cross(s, e1);
    const double u = dot(s, p) / det, v = dot(d, q) / det;
    return {dot(e2, q) / det, std::min({u, v, 1 - u - v})};
}

Mesh soup(uint32_t count, float size, uint32_t seed)
{
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> at(-5, 5), off(-size, size);
    Mesh m;
    for (uint32_t i = 0; i < count; ++i) {
        const std::array<float, 3> a = {at(random), at(random), at(random)};
        m.positions.push_back(a);
        for (int c = 0; c < 2; ++c)
            m.positions.push_back({a[0] + off(random), a[1] + off(random), a[2] + off(random)});
        if (i % 17 == 3) // without area
            m.positions.back() = m.positions[m.positions.size() - 2];
        m.faces.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    return m;
}

std::vector<RayCase> rays(uint32_t count, uint32_t seed)
{
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> at(-6, 6), way(-1, 1);
    std::vector<RayCase> list;
    for (uint32_t i = 0; i < count; ++i) {
        RayCase r{{at(random), at(random), at(random)}, 0, {way(random), way(random), way(random)}, 1e4f};
        if (i % 5 == 1) // along an axis
            r.direction = {i % 3 == 0 ? 1.f : 0.f, i % 3 == 1 ? -1.f : 0.f, i % 3 == 2 ? 1.f : 0.f};
        if (i % 7 == 2)
            r.far = 4;
        if (i % 11 == 4)
            r.near = 2;
        list.push_back(r);
    }
    return list;
}

struct Traced {
    std::vector<std::array<uint32_t, 4>> hits;
    TraceTables tables;
};

Traced trace(const Mesh& mesh, const std::vector<RayCase>& list, bool any)
{
    KernelCase k(test_device());
    Traced out{{}, trace_tables(mesh, {})};
    const auto scene = DeviceTraceScene::create(test_device(), out.tables);
    EXPECT_TRUE(scene);
    std::vector<float> table;
    for (const RayCase& r : list)
        table.insert(table.end(), {r.origin[0], r.origin[1], r.origin[2], r.near, r.direction[0], r.direction[1],
                                   r.direction[2], r.far});
    const Tensor hits = trace_rays(k.graph, scene->in(k.graph), k.input(table, 8), any);
    const Tensor read = k.output(hits.rows, 4, DType::u32, 4);
    k.graph.keep(hits, read);
    const Status status = k.compile_and_run();
    EXPECT_TRUE(status) << status.error().message;
    out.hits = k.read_array<std::array<uint32_t, 4>>(read);
    return out;
}

// the nearest meeting that is certainly inside, and the nearest that may be (by rounding)
struct Expected {
    double certain, possible;
};
Expected expected(const Mesh& m, const RayCase& ray)
{
    Expected e{double(ray.far), double(ray.far)};
    for (size_t f = 0; f < m.faces.size(); ++f) {
        const Meeting x = meet(m, f, ray);
        const double slack = 1e-4;
        if (x.inside > slack && x.t > ray.near + slack && x.t < ray.far - slack)
            e.certain = std::min(e.certain, x.t);
        if (x.inside > -slack && x.t > ray.near - slack && x.t < ray.far + slack)
            e.possible = std::min(e.possible, x.t);
    }
    return e;
}

TEST(kernel_trace_rays, finds_the_nearest_triangle_as_brute_force_does)
{
    size_t hit_count = 0;
    for (const auto& [count, size, number] :
         {std::tuple{1u, 6.f, 64u}, {5u, 5.f, 333u}, {300u, 1.f, 1001u}, {5000u, 0.4f, 700u}}) {
        const Mesh mesh = soup(count, size, count);
        const std::vector<RayCase> list = rays(number, count + 1);
        const Traced traced = trace(mesh, list, false), any = trace(mesh, list, true);
        for (size_t i = 0; i < list.size(); ++i) {
            SCOPED_TRACE(fmt::format("{} triangles, ray {}", count, i));
            const Expected e = expected(mesh, list[i]);
            const double t = std::bit_cast<float>(traced.hits[i][0]);
            ASSERT_LE(t, e.certain + 1e-3);
            ASSERT_GE(t, e.possible - 1e-3);
            const bool hit = traced.hits[i][3] != ~0u;
            ASSERT_EQ(hit, any.hits[i][3] != ~0u);
            ASSERT_EQ(hit, t < list[i].far);
            if (!hit)
                continue;
            ++hit_count;
            const Meeting m = meet(mesh, traced.tables.triangles.at(traced.hits[i][3])[3], list[i]);
            ASSERT_NEAR(m.t, t, 1e-3 * std::max(1.0, t));
            ASSERT_GT(m.inside, -1e-3);
        }
    }
    EXPECT_GT(hit_count, 300u); // of 2098
}

TEST(kernel_trace_rays, edges_and_corners_of_a_closed_surface_let_nothing_through)
{
    Mesh box; // a fan of triangles around the middle of each side: rays aim at shared edges and corners
    for (int axis = 0; axis < 3; ++axis)
        for (float side : {-1.f, 1.f}) {
            const uint32_t first = uint32_t(box.positions.size());
            const auto at = [&](float u, float v) {
                std::array<float, 3> p{};
                p[size_t(axis)] = side;
                p[size_t(axis + 1) % 3] = u;
                p[size_t(axis + 2) % 3] = v;
                box.positions.push_back(p);
            };
            at(0, 0);
            for (const auto& [u, v] : {std::pair{-1.f, -1.f}, {0.f, -1.f}, {1.f, -1.f}, {1.f, 1.f}, {-1.f, 1.f}})
                at(u, v);
            for (uint32_t i = 1; i <= 5; ++i)
                box.faces.push_back({first, first + i, first + (i % 5) + 1});
        }
    std::vector<RayCase> list;
    for (int x = -4; x <= 4; ++x)
        for (int y = -4; y <= 4; ++y)
            for (int z = -4; z <= 4; ++z)
                if (x || y || z)
                    list.push_back({{0, 0, 0}, 0, {float(x) / 4, float(y) / 4, float(z) / 4}, 1e4f});
    const Traced traced = trace(box, list, false);
    for (size_t i = 0; i < list.size(); ++i) {
        const auto& d = list[i].direction;
        const double expect = 1 / std::max({std::abs(d[0]), std::abs(d[1]), std::abs(d[2])});
        ASSERT_NEAR(std::bit_cast<float>(traced.hits[i][0]), expect, 1e-5) << i;
    }
}

TEST(kernel_trace_rays, rays_go_through_what_alpha_makes_transparent)
{
    Mesh m; // a square metre whose right half is transparent
    m.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    m.faces = {{0, 1, 2}, {0, 2, 3}};
    m.uvs = {{{{0, 0}, {1, 0}, {1, 1}}}, {{{0, 0}, {1, 1}, {0, 1}}}};
    m.face_materials = {0, 0};
    m.materials = {{.name = "leaf", .texture = 0, .alpha_cutoff = 0.5f, .alpha_texture = 0}};
    m.textures = {{{2, 1, {9, 9, 9, 9, 9, 9}}, TextureWrap::clamp, TextureWrap::clamp, {255, 0}}};
    const std::vector<RayCase> rays = {{{0.3f, 0.2f, 1}, 0, {0, 0, -1}, 10},
                                       {{0.45f, 0.8f, 1}, 0, {0, 0, -1}, 10},
                                       {{0.55f, 0.3f, 1}, 0, {0, 0, -1}, 10},
                                       {{0.9f, 0.7f, 1}, 0, {0, 0, -1}, 10}};
    const Traced cut = trace(m, rays, false);
    for (size_t i = 0; i < 4; ++i)
        EXPECT_EQ(cut.hits[i][3] == 0xffffffff, i >= 2) << i;
    EXPECT_EQ(cut.tables.triangles[cut.hits[0][3]][3], 0u); // the face that the piece is of
    EXPECT_EQ(cut.tables.triangles[cut.hits[1][3]][3], 1u);
    m.materials[0].alpha_cutoff = 0;
    const Traced whole = trace(m, rays, false);
    for (size_t i = 0; i < 4; ++i)
        EXPECT_NE(whole.hits[i][3], 0xffffffff) << i;
}

TEST(kernel_trace_rays, an_empty_scene_is_missed)
{
    Mesh empty;
    const std::vector<RayCase> list = rays(65, 3);
    for (bool any : {false, true})
        for (const auto& hit : trace(empty, list, any).hits)
            ASSERT_EQ(hit[3], ~0u);
}

// splats on the faces of a street, 10 cm apart, within 14 m of a place
std::vector<HostSplat> splats_on(const Mesh& mesh, const Point3& place)
{
    constexpr double kApart = 0.1;
    std::vector<HostSplat> splats;
    for (const auto& face : mesh.faces) {
        Vec corners[3];
        for (size_t c = 0; c < 3; ++c)
            for (size_t a = 0; a < 3; ++a)
                corners[c][a] = mesh.positions[face[c]][a];
        const Vec u = minus(corners[1], corners[0]), v = minus(corners[2], corners[0]);
        Vec n = cross(u, v);
        const double area = std::sqrt(dot(n, n));
        if (area < 1e-6)
            continue;
        for (double& x : n)
            x /= area;
        const int across = int(std::ceil(std::sqrt(dot(u, u)) / kApart)),
                  down = int(std::ceil(std::sqrt(dot(v, v)) / kApart));
        for (int i = 0; i < across; ++i)
            for (int j = 0; j < down; ++j) {
                const double s = (i + 0.5) / across, t = (j + 0.5) / down;
                if (s + t > 1)
                    continue;
                HostSplat splat{{}, n, {0.5, 0.5, 0.5}, 0.055, 0.055, 1};
                for (size_t a = 0; a < 3; ++a)
                    splat.position[a] = corners[0][a] + s * u[a] + t * v[a];
                const Vec away = minus(splat.position, place);
                if (dot(away, away) < 14 * 14)
                    splats.push_back(splat);
            }
    }
    return splats;
}

// a drive through a street with a rolling shutter: depths of splats on its faces, and of the rays of the same pixels,
// each from where the camera is when its line is read
TEST(kernel_trace_rays, a_rolling_shutter_has_the_depths_of_rays_through_the_mesh_of_a_street)
{
    const Street street = make_street({.seed = 3, .length = 70});
    const Intrinsics pinhole = pinhole_from_fov(80, 160, 100), fisheye = fisheye_from_fov(170, 128, 128);
    const CameraPath drive = drive_along(street.road, {.first = 8}, pinhole);
    const Rigid start = drive.frames[1].pose.camera_to_world();
    const std::vector<HostSplat> splats = splats_on(street.mesh, translation_of(start));
    for (const Intrinsics& k : {pinhole, fisheye}) {
        double still_median = 0, still_most = 0; // what discs and pixels make of a slanted surface
        for (const double speed : {0.0, 15.0}) {
            const double seconds = 0.05, half = 0.5 * speed / 40 * seconds; // up to 1 rad/s
            MovingCamera camera{k, start, start, ShutterDirection::down};
            if (speed > 0)
                camera.to = compose(start, rigid_from_quaternion({0.1 * speed * seconds, 0, speed * seconds},
                                                                 {0, std::sin(half), 0, std::cos(half)}, "t")
                                               .value());
            const SplatPixels got = run_splats(splats, std::vector{camera}, {.max_pairs = 1u << 22});
            const CameraView view(camera.frame());
            const Lens lens(k);
            std::vector<RayCase> rays;
            for (uint32_t i = 0; i < k.width * k.height; ++i) {
                const double x = i % k.width + 0.5, y = i / k.width + 0.5;
                const Rigid pose = interpolate(camera.from, camera.to, camera.share(y));
                const Point3 from = translation_of(pose), ray = lens.ray(x, y).value_or(Point3{0, 0, 1});
                const Vec to = minus(transform(pose, ray), from);
                RayCase r{{}, 0.2f, {}, 60};
                for (size_t a = 0; a < 3; ++a) {
                    r.origin[a] = float(from[a]);
                    r.direction[a] = float(to[a]);
                }
                rays.push_back(r);
            }
            const Traced traced = trace(street.mesh, rays, false);
            std::vector<double> errors;
            for (uint32_t i = 0; i < rays.size(); ++i) {
                const auto ray = lens.ray(i % k.width + 0.5, i / k.width + 0.5);
                const double far = double(std::bit_cast<float>(traced.hits[i][0]));
                if (ray && traced.hits[i][3] != ~0u && far < 12 && got.color[i * 4 + 3] > 0.5)
                    errors.push_back(std::abs(got.depth[i * 2 + 1] - far * lens.depth(*ray)));
            }
            std::ranges::sort(errors);
            ASSERT_GT(errors.size(), rays.size() / 4);
            const double median = errors[errors.size() / 2], most = errors[errors.size() * 95 / 100];
            fmt::print("{} {} m/s: {} splats, {} pixels, depth off by {:.2g} m (median), {:.2g} m (95 %)\n",
                       name_of(k.model), speed, splats.size(), errors.size(), median, most);
            if (speed == 0) {
                still_median = median;
                still_most = most;
            }
            EXPECT_LE(median, 1.1 * still_median + 1e-3);
            EXPECT_LE(most, 1.1 * still_most + 1e-3);
        }
    }
}

} // namespace kernel_trace_rays_test
} // namespace semrover
