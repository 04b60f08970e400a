// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/splat/rasterizer.h"
#include "tests/support/kernel_case.h"
#include "tests/support/splat_moving_reference.h"

namespace semrover {

struct SplatPixels {
    std::vector<float> color, surface, depth;
    std::vector<uint32_t> ids, owners;
    uint32_t visible = 0, pairs = 0;
};

// label of splat i is i % 20, its voxel 1000 + i; what it is of, as `owners` says, else 7 i
inline SplatTensors scene_of(KernelCase& k, const std::vector<HostSplat>& splats, std::vector<uint32_t> owners = {})
{
    std::vector<float> positions, normals, colors;
    std::vector<uint32_t> labels, cells;
    for (uint32_t i = uint32_t(owners.size()); i < splats.size(); ++i)
        owners.push_back(7 * i);
    for (const HostSplat& s : splats) {
        for (size_t a = 0; a < 3; ++a) {
            positions.push_back(float(s.position[a]));
            normals.push_back(float(s.normal[a]));
            colors.push_back(float(s.color[a]));
        }
        positions.push_back(float(s.opacity));
        normals.push_back(float(s.sigma_u));
        colors.push_back(float(s.sigma_v));
        cells.push_back(1000 + uint32_t(labels.size()));
        labels.push_back(uint32_t(labels.size() % 20));
    }
    return {k.input(positions, 4), k.input(normals, 4), k.input(colors, 4),
            k.input(labels),       k.input(cells),      k.input(owners)};
}

// runs the op on splats of the host and a table of cameras; room for all unless the options say otherwise. z: what
// pixels are tested against, with scale and offset; none: nothing
struct HostDepth {
    std::vector<float> z, scale;
};
// what each splat is of, which of that moves, and how each camera sees each mover
struct HostMovers {
    std::vector<uint32_t> owners, rows;
    std::vector<float> views; // [cameras, movers, 12]
};
inline SplatPixels run_splats(const std::vector<HostSplat>& splats, const std::vector<float>& table,
                              SplatOptions options, const HostDepth& depth_test = {}, const HostMovers& movers = {})
{
    KernelCase k(test_device());
    const uint32_t floats = splat_camera_floats(options.lens);
    const SplatTensors scene = scene_of(k, splats, movers.owners);
    if (!movers.views.empty()) {
        options.movers = k.input(movers.views, 12);
        options.mover_rows = k.input(movers.rows);
    }
    if (!options.max_visible)
        options.max_visible = uint32_t(splats.size() * table.size() / floats);
    if (!options.max_pairs)
        options.max_pairs = 1u << 18;
    if (!depth_test.z.empty())
        options.limits = splat_limits(k.graph, k.input(depth_test.z), k.input(depth_test.scale, 2));
    const SplatImages y = splat(k.graph, scene, k.input(table, floats), options);
    const auto keep = [&](const Tensor& t) {
        const Tensor out = k.output(t.rows, t.cols, t.dtype, t.ld);
        k.graph.keep(t, out);
        return out;
    };
    const Tensor color = keep(y.color), surface = keep(y.surface), depth = keep(y.depth), ids = keep(y.ids),
                 owners = keep(y.owners), visible = keep(y.visible), pairs = keep(y.pairs);
    const Status status = k.compile_and_run();
    EXPECT_TRUE(status) << status.error().message;
    return {k.read_array<float>(color),      k.read_array<float>(surface),   k.read_array<float>(depth),
            k.read_array<uint32_t>(ids),     k.read_array<uint32_t>(owners), k.read_array<uint32_t>(visible)[0],
            k.read_array<uint32_t>(pairs)[0]};
}

inline SplatPixels run_splats(const std::vector<HostSplat>& splats, const std::vector<HostCamera>& cameras,
                              const SplatOptions& options, const HostDepth& depth_test = {},
                              const HostMovers& movers = {})
{
    std::vector<float> table;
    for (const HostCamera& c : cameras) {
        for (double v : {c.fx, c.fy, c.cx, c.cy})
            table.push_back(float(v));
        for (double v : c.view)
            table.push_back(float(v));
    }
    return run_splats(splats, table, options, depth_test, movers);
}

// cameras with lenses, all of one model and size
inline SplatPixels run_splats(const std::vector<HostSplat>& splats, const std::vector<LensCamera>& cameras,
                              SplatOptions options = {}, const HostMovers& movers = {})
{
    std::vector<float> table(cameras.size() * kLensCameraFloats);
    for (size_t i = 0; i < cameras.size(); ++i) {
        Pose pose;
        std::ranges::copy(cameras[i].view, pose.world_to_camera.begin());
        write_row(splat_camera(cameras[i].intrinsics, pose),
                  std::span(table).subspan(i * kLensCameraFloats, kLensCameraFloats));
    }
    const Intrinsics& k = cameras[0].intrinsics;
    options.width = k.width;
    options.height = k.height;
    options.lens = SplatLens(uint32_t(k.model));
    return run_splats(splats, table, options, {}, movers);
}

// cameras that move while they are read out, all of one model and size
inline SplatPixels run_splats(const std::vector<HostSplat>& splats, const std::vector<MovingCamera>& cameras,
                              SplatOptions options = {}, const HostMovers& movers = {})
{
    std::vector<float> table(cameras.size() * kLensCameraFloats);
    for (size_t i = 0; i < cameras.size(); ++i)
        write_row(splat_camera(cameras[i].frame(), true),
                  std::span(table).subspan(i * kLensCameraFloats, kLensCameraFloats));
    const CameraFrame frame = cameras[0].frame();
    options.width = frame.intrinsics.width;
    options.height = frame.intrinsics.height;
    options.lens = lens_of(drawn_model(frame.intrinsics.model, true));
    options.moving = true;
    return run_splats(splats, table, options, {}, movers);
}

// splats of all sizes in front of a camera that looks along +z, values as fp32 has them
inline std::vector<HostSplat> random_splats(uint32_t n, uint32_t seed, double smallest = 0.01, double largest = 0.35)
{
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(0, 1);
    std::normal_distribution<double> normal;
    const auto f = [](double v) { return double(float(v)); };
    std::vector<HostSplat> out;
    for (uint32_t i = 0; i < n; ++i) {
        HostSplat s;
        s.position = {f(6 * unit(random) - 3), f(4 * unit(random) - 2), f(1.5 + 7.5 * unit(random))};
        Vector v = {normal(random), normal(random), normal(random)};
        const double length = std::sqrt(dot(v, v));
        s.normal = {f(v[0] / length), f(v[1] / length), f(v[2] / length)};
        s.color = {f(unit(random)), f(unit(random)), f(unit(random))};
        s.sigma_u = f(smallest + (largest - smallest) * unit(random));
        s.sigma_v = f(smallest + (largest - smallest) * unit(random));
        s.opacity = f(0.3 + 0.7 * unit(random));
        out.push_back(s);
    }
    return out;
}

inline double narrowed(double v)
{
    return double(float(v));
}

// splats all around the origin, 0.5 to 9 m away
inline std::vector<HostSplat> splats_around(uint32_t n, uint32_t seed, double smallest = 0.01, double largest = 0.35)
{
    std::vector<HostSplat> splats = random_splats(n, seed, smallest, largest);
    std::mt19937 random(seed + 1);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> unit(0, 1);
    for (HostSplat& s : splats) {
        Vector p = {normal(random), normal(random), normal(random)};
        const double length = std::sqrt(dot(p, p)), away = 0.5 + 8.5 * unit(random);
        for (size_t a = 0; a < 3; ++a)
            s.position[a] = narrowed(p[a] / length * away);
    }
    return splats;
}

// moved sideways and turned about y by `yaw`; the numbers as fp32 has them
inline HostCamera camera_for(uint32_t width, uint32_t height, double yaw = 0, double shift = 0)
{
    const auto f = [](double v) { return double(float(v)); };
    return {f(0.9 * width),
            f(0.95 * width),
            f(width / 2.0 + 1.3),
            f(height / 2.0 - 0.7),
            {f(std::cos(yaw)), 0, f(std::sin(yaw)), f(shift), 0, 1, 0, 0, f(-std::sin(yaw)), 0, f(std::cos(yaw)), 0}};
}

// how many of the values are further off than tolerance, and than four times it
struct Misses {
    size_t some = 0, gross = 0;
    void add(double got, double expect, double tolerance)
    {
        some += !(std::abs(got - expect) <= tolerance);
        gross += !(std::abs(got - expect) <= 4 * tolerance);
    }
};

// docs/numerics.md §6.1: 2e-3, but for a thousandth of the values, where a threshold may flip
// owners: of the splats
inline void compare(const SplatPixels& got, const std::vector<ReferencePixel>& expect, size_t camera,
                    const std::vector<uint32_t>& owners = {})
{
    Misses misses;
    size_t ids_differ = 0;
    double deepest = 1;
    for (const ReferencePixel& e : expect)
        deepest = std::max(deepest, e.depth);
    for (size_t i = 0; i < expect.size(); ++i) {
        const ReferencePixel& e = expect[i];
        const size_t at = camera * expect.size() + i;
        for (size_t a = 0; a < 3; ++a) {
            misses.add(got.color[at * 4 + a], e.color[a], 2e-3);
            misses.add(got.surface[at * 4 + a], e.normal[a], 2e-3);
        }
        misses.add(got.color[at * 4 + 3], e.alpha, 2e-3);
        misses.add(got.surface[at * 4 + 3], e.depth, 2e-3 * deepest);
        misses.add(got.depth[at * 2], e.alpha > 0 ? e.depth / e.alpha : 0, 2e-3 * deepest);
        misses.add(got.depth[at * 2 + 1], e.median, 2e-3 * deepest);
        const uint32_t cell = e.splat < 0 ? ~0u : 1000 + uint32_t(e.splat),
                       label = e.splat < 0 ? ~0u : uint32_t(e.splat % 20);
        const uint32_t owner = e.splat < 0 ? 0 : owners.empty() ? 7 * uint32_t(e.splat) : owners[size_t(e.splat)];
        ids_differ += got.ids[at * 2] != label || got.ids[at * 2 + 1] != cell || got.owners[at] != owner;
    }
    EXPECT_LE(misses.some, expect.size() * 10 / 1000);
    EXPECT_LE(misses.gross, expect.size() * 10 / 10000);
    EXPECT_LE(ids_differ, expect.size() / 200 + 1);
}

inline bool same(const SplatPixels& a, const SplatPixels& b)
{
    return a.color == b.color && a.surface == b.surface && a.depth == b.depth && a.ids == b.ids && a.owners == b.owners;
}

} // namespace semrover
