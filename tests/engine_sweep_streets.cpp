// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/camera/camera_view.h"
#include "engine/job/lidar_returns.h"
#include "engine/scene/scene_points.h"
#include "tests/support/sweep_case.h"
#include "tools/streets/street_grid.h"
#include "tools/trace/trace_scene.h"

#include <algorithm>
#include <bit>
#include <map>

namespace semrover {
namespace engine_sweep_streets_test {

struct Ray {
    Point3 from, to; // unit
};
struct Hit {
    double range = 0; // infinite: nothing
    Point3 normal{};
    uint32_t label = 255;
};

// a made street, and what rays meet of its mesh
class Made {
  public:
    // note: of 60 m kNN needs more than a binding has with lowered limits
    Made() : street_(make_street({.seed = 5, .length = 45})), tables_(trace_tables(street_.mesh, {}))
    {
        const StreetGrids grids = street_grids(test_device(), street_, {}).value();
        const ScenePoints points = points_of(grids.truth);
        scene.emplace(DrawnScene{SplatScene::create(test_device(), points, {.auto_sigma = true}).value()});
    }

    std::vector<Hit> trace(const std::vector<Ray>& rays) const
    {
        KernelCase k(test_device());
        const auto device_scene = DeviceTraceScene::create(test_device(), tables_);
        EXPECT_TRUE(device_scene);
        const Point3& origin = street_.mesh.origin;
        std::vector<float> table;
        for (const Ray& r : rays) {
            for (size_t i = 0; i < 3; ++i)
                table.push_back(float(r.from[i] - origin[i]));
            table.push_back(0.01f);
            for (const double v : r.to)
                table.push_back(float(v));
            table.push_back(1000);
        }
        const Tensor hits = trace_rays(k.graph, device_scene->in(k.graph), k.input(table, 8));
        const Tensor read = k.output(hits.rows, 4, DType::u32, 4);
        k.graph.keep(hits, read);
        const Status status = k.compile_and_run();
        EXPECT_TRUE(status) << status.error().message;
        std::vector<Hit> found;
        for (const auto& hit : k.read_array<std::array<uint32_t, 4>>(read))
            found.push_back(hit[3] == ~0u ? Hit{INFINITY} : of_triangle(std::bit_cast<float>(hit[0]), hit[3]));
        return found;
    }

    // 1.9 m above the ground
    Rigid sensor_at(double x, double y, double yaw) const
    {
        const double up = 40 - trace({{{x, y, 40}, {0, 0, -1}}})[0].range + 1.9;
        return rigid_from_quaternion({x, y, up}, {0, 0, std::sin(yaw / 2), std::cos(yaw / 2)}, "sensor").value();
    }

    std::optional<DrawnScene> scene;

  private:
    Hit of_triangle(double range, uint32_t triangle) const
    {
        const auto& t = tables_.triangles[triangle];
        const auto number = [&](size_t i) { return double(std::bit_cast<float>(t[i])); };
        const Point3 a = {number(4), number(5), number(6)}, b = {number(8), number(9), number(10)};
        Point3 n = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
        const double length = std::hypot(n[0], n[1], n[2]);
        return {range, {n[0] / length, n[1] / length, n[2] / length}, t[11] & 0xff};
    }

    Street street_;
    TraceTables tables_;
};

class engine_sweep_streets : public testing::Test {
  protected:
    static void SetUpTestSuite() { street.emplace(); }
    static void TearDownTestSuite() { street.reset(); } // before the device goes
    static const Made& made() { return *street; }

    static inline std::optional<Made> street;
};

Point3 along(const Ray& ray, double range)
{
    return {ray.from[0] + range * ray.to[0], ray.from[1] + range * ray.to[1], ray.from[2] + range * ray.to[2]};
}

double from_plane(const Point3& p, const Point3& q, const Point3& normal)
{
    return std::abs((p[0] - q[0]) * normal[0] + (p[1] - q[1]) * normal[1] + (p[2] - q[2]) * normal[2]);
}

// all rays of a sweep and what they meet in truth
struct Truth {
    std::vector<Ray> rays; // [beams, columns]
    std::vector<Hit> hits;
    std::vector<bool> flat; // with the rays around it on one plane
};
Truth truth_of(const Made& made, const LidarSweep& sweep)
{
    const Lidar& lidar = *sweep.lidar;
    const uint32_t beams = uint32_t(lidar.beams.size());
    Truth t;
    for (uint32_t beam = 0; beam < beams; ++beam)
        for (uint32_t column = 0; column < lidar.columns; ++column) {
            const Rigid pose = sweep.at(beam, column);
            const Point3 from = translation_of(pose), ahead = transform(pose, lidar.ray(beam, column));
            t.rays.push_back({from, {ahead[0] - from[0], ahead[1] - from[1], ahead[2] - from[2]}});
        }
    t.hits = made.trace(t.rays);
    t.flat.resize(t.rays.size());
    for (uint32_t beam = 1; beam + 1 < beams; ++beam)
        for (uint32_t column = 1; column + 1 < lidar.columns; ++column) {
            const size_t at = size_t(beam) * lidar.columns + column;
            bool flat = std::isfinite(t.hits[at].range);
            for (const size_t other : {at - lidar.columns, at + lidar.columns, at - 1, at + 1})
                flat = flat && std::isfinite(t.hits[other].range) && t.hits[other].label == t.hits[at].label &&
                       from_plane(along(t.rays[other], t.hits[other].range), along(t.rays[at], t.hits[at].range),
                                  t.hits[at].normal) < 1e-3;
            t.flat[at] = flat;
        }
    return t;
}

LidarSweep sweep_from(const Rigid& begin, const Rigid& end)
{
    Lidar lidar = named_lidar("xt32").value();
    lidar.columns = 500;
    for (LidarBeam& beam : lidar.beams)
        beam.azimuth = beam.delay = 0;
    return {0, "top", std::make_shared<const Lidar>(lidar), begin, end};
}

double median(std::vector<double>& values, double share = 0.5)
{
    const auto at = values.begin() + ptrdiff_t(share * double(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

TEST_F(engine_sweep_streets, ranges_on_flat_faces_are_those_of_the_ray_tracer)
{
    for (const double metres : {0.0, 2.0}) {
        const LidarSweep sweep = sweep_from(made().sensor_at(15, -1.5, 0.05), made().sensor_at(15 + metres, -1.5, 0.1));
        const Truth truth = truth_of(made(), sweep);
        const SweepImage image = draw_sweep(*made().scene, sweep);
        const SweepPicture picture(*sweep.lidar);
        std::map<uint32_t, std::vector<double>> errors; // by class
        std::vector<double> all, off_plane;
        size_t lost = 0, flat = 0;
        for (size_t i = 0; i < truth.rays.size(); ++i) {
            const size_t at = pixel_of(picture, uint32_t(i / sweep.lidar->columns), uint32_t(i % sweep.lidar->columns));
            if (!truth.flat[i] || truth.hits[i].range > 60)
                continue;
            ++flat;
            lost += image.alpha[at] < 0.5f;
            if (image.alpha[at] < 0.5f)
                continue;
            all.push_back(std::abs(image.range[at] - truth.hits[i].range));
            errors[truth.hits[i].label].push_back(all.back());
            off_plane.push_back(from_plane(along(truth.rays[i], image.range[at]),
                                           along(truth.rays[i], truth.hits[i].range), truth.hits[i].normal));
        }
        ASSERT_GT(all.size(), 2000u);
        EXPECT_LE(median(all), 0.01);
        EXPECT_LE(median(off_plane), 0.005);
        EXPECT_LE(median(all, 0.9), 0.15);
        EXPECT_LT(lost, flat / 20);
        const std::string name = metres > 0 ? "moving" : "standing";
        RecordProperty(name, fmt::format("{} of {} rays lost; range {:.4f} median, {:.4f} p90; off the plane {:.4f}, "
                                         "{:.4f} m",
                                         lost, flat, median(all), median(all, 0.9), median(off_plane),
                                         median(off_plane, 0.9)));
        for (auto& [label, list] : errors)
            RecordProperty(
                fmt::format("{}_{}", name, label),
                fmt::format("{} rays: {:.4f} median, {:.4f} p90", list.size(), median(list), median(list, 0.9)));
    }
}

// what a camera at the same place sees of planes
TEST_F(engine_sweep_streets, points_and_depth_pictures_agree_on_planes)
{
    const Rigid sensor = made().sensor_at(15, -1.5, 0.05);
    const LidarSweep sweep = sweep_from(sensor, sensor);
    const Truth truth = truth_of(made(), sweep);
    const SweepImage image = draw_sweep(*made().scene, sweep);
    const SweepPicture picture(*sweep.lidar);
    CameraFrame frame;
    frame.intrinsics = pinhole_from_fov(90, 640, 400);
    frame.pose.world_to_camera = compose({0, -1, 0, 0, 0, 0, -1, 0, 1, 0, 0, 0, 0, 0, 0, 1}, inverse(sensor));
    auto rasterizer = Rasterizer::create(test_device(), made().scene->splats, 640, 400, 1).value();
    const SplatCamera camera = splat_camera(frame, false);
    const SplatImage seen = rasterizer->render({&camera, 1}).value().front();
    const CameraView view(frame);
    std::vector<double> apart;
    for (size_t i = 0; i < truth.rays.size(); ++i) {
        const size_t at = pixel_of(picture, uint32_t(i / sweep.lidar->columns), uint32_t(i % sweep.lidar->columns));
        if (!truth.flat[i] || image.alpha[at] < 0.5f || image.range[at] > 40)
            continue;
        const Point3 point = along(truth.rays[i], image.range[at]);
        const auto pixel = view.project(point);
        if (!pixel || !(pixel->x >= 0 && pixel->x < 640 && pixel->y >= 0 && pixel->y < 400))
            continue;
        const size_t x = size_t(pixel->x), y = size_t(pixel->y), of = y * 640 + x;
        if (!seen.visible[of])
            continue;
        const auto surface = view.surface(double(x) + 0.5, double(y) + 0.5, seen.depth_median[of]);
        apart.push_back(from_plane(point, *surface, truth.hits[i].normal));
    }
    ASSERT_GT(apart.size(), 500u);
    EXPECT_LE(median(apart), 0.02);
    RecordProperty(
        "apart", fmt::format("{} points: {:.4f} median, {:.4f} p90", apart.size(), median(apart), median(apart, 0.9)));
}

} // namespace engine_sweep_streets_test
} // namespace semrover
