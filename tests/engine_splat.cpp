// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/deferred/frame_images.h"
#include "engine/splat/splat_pool.h"
#include "tests/support/frame_pixels_reference.h"
#include "tests/support/golden_tensors.h"
#include "tests/support/json_text.h"
#include "tests/support/splat_case.h"
#include "tools/verify/splat_cases.cpp"
#include "tools/verify/splat_cases.h"

#include <numbers>

namespace semrover {
namespace engine_splat_test {

std::array<float, 3> floats(const Vector& v)
{
    return {float(v[0]), float(v[1]), float(v[2])};
}

Splats splats_of(const std::vector<HostSplat>& splats)
{
    Splats out;
    for (const HostSplat& s : splats) {
        out.position.push_back(floats(s.position));
        out.normal.push_back(floats(s.normal));
        out.color.push_back(floats(s.color));
        out.sigma_u.push_back(float(s.sigma_u));
        out.sigma_v.push_back(float(s.sigma_v));
        out.opacity.push_back(float(s.opacity));
        out.label.push_back(uint8_t(out.label.size() % 20));
    }
    return out;
}

ScenePoints points_only(const std::vector<HostSplat>& splats)
{
    ScenePoints out;
    for (const HostSplat& s : splats) {
        out.positions.push_back(floats(s.position));
        out.colors.push_back(floats(s.color));
        out.labels.push_back(0);
        out.cells.push_back(uint32_t(out.cells.size()));
    }
    return out;
}

SplatCamera device_camera(const HostCamera& c)
{
    SplatCamera out{float(c.fx), float(c.fy), float(c.cx), float(c.cy), {}};
    for (size_t i = 0; i < 12; ++i)
        out.world_to_camera[i] = float(c.view[i]);
    return out;
}

template <typename... Args>
SplatScene make_scene(const Args&... args)
{
    auto scene = SplatScene::create(test_device(), args...);
    SR_ASSERT(bool(scene), "{}", scene.error().message);
    return std::move(*scene);
}

std::vector<SplatImage> render(const SplatScene& scene, uint32_t width, uint32_t height, uint32_t max_cameras,
                               const std::vector<SplatCamera>& cameras, const RasterizerOptions& options = {})
{
    auto rasterizer = Rasterizer::create(test_device(), scene, width, height, max_cameras, options);
    SR_ASSERT(bool(rasterizer), "{}", rasterizer.error().message);
    auto images = (*rasterizer)->render(cameras);
    SR_ASSERT(bool(images), "{}", images.error().message);
    return std::move(*images);
}

// tests/golden/README.md: tolerance times max(1, max |expect|), four times that for a thousandth of the values
void expect_close(const std::vector<float>& got, const std::vector<float>& expect, double tolerance, const char* what)
{
    ASSERT_EQ(got.size(), expect.size()) << what;
    double scale = 1, worst = 0;
    for (float e : expect)
        scale = std::max(scale, double(std::abs(e)));
    size_t outliers = 0;
    for (size_t i = 0; i < got.size(); ++i) {
        const double error = std::abs(double(got[i]) - expect[i]) / scale;
        worst = std::max(worst, error);
        outliers += error > tolerance;
    }
    EXPECT_LE(outliers, got.size() / 1000) << what << ": " << worst;
    EXPECT_LE(worst, 4 * tolerance) << what;
    testing::Test::RecordProperty(what, fmt::format("{:.2e}", worst));
}

TEST(engine_splat, golden_renders_come_out)
{
    for (const char* name : {"splat_dense", "splat_odd_size"}) {
        SCOPED_TRACE(name);
        const GoldenTensors file(name);
        SplatRenderCase c;
        c.positions = file.get<float>("input.positions");
        c.normals = file.get<float>("input.normals");
        c.colors = file.get<float>("input.colors");
        c.opacities = file.get<float>("input.opacities");
        c.scales = file.get<float>("input.scales");
        c.view = file.get<float>("input.view");
        c.intrinsics = file.get<float>("input.intrinsics");
        c.width = file.params.at("width");
        c.height = file.params.at("height");
        c.cutoff_sigma = file.params.at("cutoff_sigma");
        const auto image = run_splat_render(test_device(), c);
        ASSERT_TRUE(image) << image.error().message;
        expect_close(image->color, file.get<float>("expect.color"), 2e-3, "color");
        expect_close(image->alpha, file.get<float>("expect.alpha"), 2e-3, "alpha");
        expect_close(image->depth_sum, file.get<float>("expect.depth"), 2e-3, "depth");
        expect_close(image->normal, file.get<float>("expect.normal"), 2e-3, "normal");
    }
}

TEST(engine_splat, golden_normals_come_out)
{
    const GoldenTensors file("pca_normals");
    const std::vector<float> positions = file.get<float>("input.positions"), expect = file.get<float>("expect.normals");
    auto got = run_pca_normals(test_device(), positions, 16);
    ASSERT_TRUE(got) << got.error().message;
    double worst = 0, worst_value = 0;
    for (size_t i = 0; i < expect.size(); i += 3) {
        const double along =
            got->normals[i] * expect[i] + got->normals[i + 1] * expect[i + 1] + got->normals[i + 2] * expect[i + 2];
        for (size_t a = 0; a < 3; ++a)
            worst = std::max(worst, std::abs(double(got->normals[i + a]) * (along < 0 ? -1 : 1) - expect[i + a]));
    }
    const std::vector<float> values = file.get<float>("expect.eigenvalues");
    for (size_t i = 0; i < values.size(); ++i)
        worst_value = std::max(worst_value, std::abs(double(got->eigenvalues[i]) - values[i]));
    EXPECT_LE(worst, 1e-4);
    EXPECT_LE(worst_value, 1e-4);
    RecordProperty("normals", fmt::format("{:.2e}", worst));
    RecordProperty("eigenvalues", fmt::format("{:.2e}", worst_value));
}

// docs/method.md §5.2: points at random on a road, as dense as a grid's, cover 1 - exp(-density 2 pi
// sigma^2) of it; auto sigma closes the holes
TEST(engine_splat, a_road_is_as_opaque_as_its_density_says)
{
    std::mt19937 random(5);
    std::uniform_real_distribution<double> unit(0, 1);
    const double density = 20 / 0.36, side = 8;
    std::vector<HostSplat> splats(size_t(density * side * side));
    for (HostSplat& s : splats)
        s.position = {side * unit(random) - side / 2, side * unit(random) - side / 2, 0};
    const ScenePoints points = points_only(splats);
    // from 5 m above, straight down
    const SplatCamera camera{300, 300, 100, 100, {1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 5}};
    const auto mean_alpha = [&](const PointSplatOptions& options) {
        const auto images = render(make_scene(points, options), 200, 200, 1, {camera});
        double sum = 0;
        for (float a : images[0].alpha)
            sum += a;
        return sum / (200 * 200);
    };
    for (float sigma : {0.04f, 0.08f}) {
        const double expect = 1 - std::exp(-density * 2 * std::numbers::pi * sigma * sigma);
        EXPECT_NEAR(mean_alpha({.sigma = sigma}), expect, 0.03 * expect);
    }
    EXPECT_GT(mean_alpha({.auto_sigma = true}), 0.85);
}

TEST(engine_splat, cameras_in_turns_or_at_once_see_the_same)
{
    const SplatScene scene = make_scene(splats_of(random_splats(800, 4)));
    std::vector<SplatCamera> cameras;
    for (int i = 0; i < 5; ++i)
        cameras.push_back(device_camera(camera_for(70, 50, 0.1 * i, 0.2 * i)));
    const auto at_once = render(scene, 70, 50, 5, cameras), in_turns = render(scene, 70, 50, 2, cameras);
    ASSERT_EQ(at_once.size(), 5u);
    ASSERT_EQ(in_turns.size(), 5u);
    for (size_t i = 0; i < 5; ++i) {
        EXPECT_EQ(at_once[i].color, in_turns[i].color);
        EXPECT_EQ(at_once[i].depth_median, in_turns[i].depth_median);
        EXPECT_EQ(at_once[i].cell, in_turns[i].cell);
    }
}

TEST(engine_splat, a_frame_that_needs_more_room_is_drawn_again)
{
    const SplatScene scene = make_scene(splats_of(random_splats(3000, 4)));
    const std::vector<SplatCamera> cameras = {device_camera(camera_for(200, 100)),
                                              device_camera(camera_for(200, 100, 0.2))};
    auto rasterizer = Rasterizer::create(test_device(), scene, 200, 100, 2, {.max_pairs = 50});
    ASSERT_TRUE(rasterizer) << rasterizer.error().message;
    const auto grown = (*rasterizer)->render(cameras);
    ASSERT_TRUE(grown) << grown.error().message;
    EXPECT_GT((*rasterizer)->rebuilds(), 0u);
    const uint32_t rebuilds = (*rasterizer)->rebuilds();
    const auto again = (*rasterizer)->render(cameras),
               roomy = Result<std::vector<SplatImage>>(render(scene, 200, 100, 2, cameras));
    EXPECT_EQ((*rasterizer)->rebuilds(), rebuilds);
    for (size_t i = 0; i < 2; ++i) {
        EXPECT_EQ((*grown)[i].color, (*roomy)[i].color);
        EXPECT_EQ((*again)[i].color, (*roomy)[i].color);
    }
}

TEST(engine_splat, pixels_on_the_device_are_those_that_files_of_the_images_hold)
{
    const SplatScene scene = make_scene(splats_of(random_splats(400, 9)));
    std::vector<SplatCamera> cameras;
    for (int i = 0; i < 3; ++i)
        cameras.push_back(device_camera(camera_for(75, 41, 0.1 * i, 0.2 * i)));
    const std::array<uint8_t, 3> background{9, 200, 77};
    const std::vector<SplatImage> images = render(scene, 75, 41, 2, cameras);
    const auto rasterizer =
        *Rasterizer::create(test_device(), scene, 75, 41, 2, {.max_pairs = 100, .pixels_over = background});
    size_t next = 0;
    while (next < cameras.size()) {
        const uint32_t drawn = *rasterizer->draw(std::span(cameras).subspan(next));
        ASSERT_LE(drawn, 2u);
        for (uint32_t i = 0; i < drawn; ++i, ++next) {
            const SplatPixelSlots slots = rasterizer->pixels(i);
            const auto seen = *slots.seen.read<uint32_t>(test_device()),
                       depths = *slots.depths.read<uint32_t>(test_device()),
                       normals = *slots.normals.read<uint32_t>(test_device());
            const auto color = color_pixels(images[next], background), normal = normal_pixels(images[next]),
                       label = label_pixels(images[next]), visible = visible_pixels(images[next]);
            const auto depth = depth_pixels(images[next]);
            for (size_t p = 0; p < seen.size(); ++p) {
                for (size_t c = 0; c < 3; ++c) {
                    ASSERT_EQ(seen[p] >> 8 * c & 255, color[3 * p + c]);
                    ASSERT_EQ(normals[p] >> 8 * c & 255, normal[3 * p + c]);
                }
                ASSERT_EQ(seen[p] >> 24, visible[p]);
                ASSERT_EQ(depths[p], depth[p]);
                ASSERT_EQ(normals[p] >> 24, label[p]);
            }
        }
    }
    EXPECT_EQ(next, 3u);
}

TEST(engine_splat, a_large_image_holds_the_texels_of_the_device_also_in_memory_of_an_earlier_one)
{
    constexpr uint32_t kWidth = 1003, kHeight = 601;
    const SplatCamera camera = device_camera(camera_for(kWidth, kHeight));
    for (const char* limits : {"", "staging=1"}) {
        auto device = Device::create({.limits = limits});
        ASSERT_TRUE(device);
        auto scene = SplatScene::create(**device, splats_of(random_splats(300, 9)));
        ASSERT_TRUE(scene);
        auto rasterizer = Rasterizer::create(**device, *scene, kWidth, kHeight, 1);
        ASSERT_TRUE(rasterizer);
        std::vector<SplatImage> images(3); // as many as there are cameras is what it becomes
        for (int turn = 0; turn < 2; ++turn) {
            ASSERT_TRUE((*rasterizer)->render({&camera, 1}, images));
            ASSERT_EQ(images.size(), 1u);
            const SplatImage& image = images[0];
            const SplatSlots slots = (*rasterizer)->images(0);
            const auto color = *slots.color.read<float>(**device), surface = *slots.surface.read<float>(**device),
                       depth = *slots.depth.read<float>(**device);
            const auto ids = *slots.ids.read<uint32_t>(**device);
            ASSERT_EQ(image.alpha.size(), size_t(kWidth) * kHeight);
            for (size_t i = 0; i < image.alpha.size(); ++i) {
                for (size_t c = 0; c < 3; ++c) {
                    ASSERT_EQ(image.color[i * 3 + c], color[i * 4 + c]);
                    ASSERT_EQ(image.normal[i * 3 + c], surface[i * 4 + c]);
                }
                ASSERT_EQ(image.alpha[i], color[i * 4 + 3]);
                ASSERT_EQ(image.depth_sum[i], surface[i * 4 + 3]);
                ASSERT_EQ(image.depth_expected[i], depth[i * 2]);
                ASSERT_EQ(image.depth_median[i], depth[i * 2 + 1]);
                ASSERT_EQ(image.label[i], ids[i * 2]);
                ASSERT_EQ(image.cell[i], ids[i * 2 + 1]);
                ASSERT_EQ(image.visible[i], image.alpha[i] >= 0.5f);
            }
        }
    }
}

TEST(engine_splat, visible_pixels_are_those_that_reach_the_threshold)
{
    const SplatScene scene = make_scene(splats_of(random_splats(300, 9)));
    const SplatImage image = render(scene, 60, 40, 1, {device_camera(camera_for(60, 40))}, {.visible_alpha = 0.3f})[0];
    size_t count = 0;
    for (size_t i = 0; i < image.alpha.size(); ++i) {
        ASSERT_EQ(image.visible[i], image.alpha[i] >= 0.3f);
        ASSERT_NEAR(image.depth_expected[i] * image.alpha[i], image.depth_sum[i], 1e-4);
        ASSERT_EQ(image.cell[i] == SplatImage::kNothing, image.alpha[i] == 0);
        count += image.visible[i];
    }
    EXPECT_GT(count, 0u);
    EXPECT_LT(count, image.alpha.size());
}

TEST(engine_splat, a_scene_without_splats_and_an_image_of_one_pixel_work)
{
    const SplatScene nothing = make_scene(ScenePoints{});
    EXPECT_EQ(nothing.size(), 0u);
    const auto empty = render(nothing, 17, 3, 2, {device_camera(camera_for(17, 3)), device_camera(camera_for(17, 3))});
    ASSERT_EQ(empty.size(), 2u);
    EXPECT_EQ(empty[1].alpha, std::vector<float>(17 * 3, 0));
    EXPECT_EQ(empty[1].label, std::vector<uint32_t>(17 * 3, SplatImage::kNothing));
    HostSplat one = random_splats(1, 1)[0];
    one.position = {0, 0, 2};
    one.normal = {0, 0, 1};
    const SplatCamera camera{1, 1, 0.5f, 0.5f, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
    const auto pixel = render(make_scene(splats_of({one})), 1, 1, 1, {camera});
    EXPECT_NEAR(pixel[0].alpha[0], std::min(0.99, one.opacity), 1e-6);
    EXPECT_NEAR(pixel[0].depth_median[0], 2, 1e-6);
    EXPECT_EQ(pixel[0].cell[0], 0u);
}

TEST(engine_splat, what_is_not_a_splat_is_counted)
{
    std::vector<HostSplat> splats = random_splats(20, 2);
    splats[3].position[0] = NAN;
    splats[5].opacity = 0;
    splats[7].sigma_v = 0;
    splats[9].normal = {0, 0, 0};
    splats[11].color[2] = INFINITY;
    EXPECT_EQ(make_scene(splats_of(splats)).skipped(), 5u);
    EXPECT_EQ(make_scene(points_only(splats)).skipped(), 2u); // normals, sigmas and opacities are ours then
}

TEST(engine_splat, wrong_inputs_are_told)
{
    Splats points = splats_of(random_splats(4, 2));
    points.color.pop_back();
    EXPECT_EQ(SplatScene::create(test_device(), points).error().code, ErrorCode::bad_input);
    const SplatScene scene = make_scene(splats_of(random_splats(4, 2)));
    EXPECT_EQ(Rasterizer::create(test_device(), scene, 0, 10, 1).error().code, ErrorCode::usage);
    EXPECT_EQ(Rasterizer::create(test_device(), scene, 60000, 60000, 1).error().code, ErrorCode::out_of_memory);
    auto rasterizer = Rasterizer::create(test_device(), scene, 10, 10, 1);
    ASSERT_TRUE(rasterizer);
    SplatCamera camera = device_camera(camera_for(10, 10));
    camera.world_to_camera[3] = NAN;
    EXPECT_EQ((*rasterizer)->render({&camera, 1}).error().code, ErrorCode::bad_input);
    EXPECT_EQ((*rasterizer)->render({}).value().size(), 0u);
}

TEST(engine_splat, splats_are_read_back_as_they_are_drawn)
{
    const Splats made = splats_of(random_splats(50, 6));
    const auto complete = make_scene(made).read();
    ASSERT_TRUE(complete) << complete.error().message;
    EXPECT_EQ(complete->position, made.position);
    EXPECT_EQ(complete->normal, made.normal);
    EXPECT_EQ(complete->sigma_v, made.sigma_v);
    EXPECT_EQ(complete->label, made.label);
    ScenePoints wall; // x = 1
    for (int i = 0; i < 400; ++i) {
        wall.positions.push_back({1, 0.1f * float(i % 20), 0.1f * float(i / 20)});
        wall.colors.push_back({0.5f, 0.25f, 1});
        wall.labels.push_back(2);
        wall.cells.push_back(0);
    }
    const auto derived = make_scene(wall, PointSplatOptions{.opacity = 0.5f}).read(),
               spaced = make_scene(wall, PointSplatOptions{.auto_sigma = true}).read();
    for (size_t i = 0; i < 400; ++i) {
        ASSERT_NEAR(derived->normal[i][0], 1, 1e-5);
        ASSERT_EQ(derived->sigma_u[i], 0.04f);
        ASSERT_EQ(derived->opacity[i], 0.5f);
        ASSERT_EQ(derived->color[i], wall.colors[i]);
        if (i % 20 != 0 && i % 20 != 19) { // three of the nearest points are 0.1 m away
            ASSERT_NEAR(spaced->sigma_v[i], 0.095, 1e-4) << i;
        }
    }
}

// ---- pools

// a wavy floor that begins at x, of two labels
ScenePoints floor_at(float x, size_t count)
{
    std::mt19937 random(uint32_t(count) + 7);
    std::uniform_real_distribution<float> along(0, 4);
    ScenePoints out;
    for (size_t i = 0; i < count; ++i) {
        const float u = along(random), v = along(random);
        out.positions.push_back({x + u, v - 2, 0.3f * std::sin(u)});
        out.colors.push_back({u / 4, v / 4, 0.5f});
        out.labels.push_back(u < 2 ? 0 : 2);
        out.cells.push_back(uint32_t(i));
    }
    return out;
}

// above (2, 0), looking down
SplatCamera camera_above()
{
    return {40, 40, 32, 24, {0, -1, 0, 0, -1, 0, 0, 2, 0, 0, -1, 6}};
}

std::unique_ptr<SplatPool> pool_of(uint64_t bytes)
{
    auto pool = SplatPool::create(test_device(), bytes);
    SR_ASSERT(bool(pool), "{}", pool.error().message);
    return std::move(*pool);
}

void add(SplatPool& pool, const TileIndex& tile, const ScenePoints& points, const PointSplatOptions& options = {})
{
    const auto added = pool.add(tile, points, points.size(), options);
    ASSERT_TRUE(added) << added.error().message;
    ASSERT_EQ(*added, SplatPool::Room::found);
}

// what the thread that draws does once a frame: the frame has ended when this returns
void show(SplatPool& pool)
{
    Device& device = test_device();
    ASSERT_TRUE(pool.publish());
    const auto ring = *CommandRing::create(device, 1);
    if (pool.record_updates(*ring->begin()))
        pool.updates_are_submitted(device.next_point());
    ASSERT_TRUE(device.wait(*ring->submit()));
}

std::vector<uint32_t> blocks_of(const SplatPool& pool)
{
    return *pool.scene().blocks().read<uint32_t>(test_device());
}

SplatImage picture_of(const SplatPool& pool)
{
    const SplatCamera seen_by = camera_above();
    const auto rasterizer = *Rasterizer::create(test_device(), pool.scene(), 64, 48, 1, {.rows = pool.end()});
    return (*rasterizer->render({&seen_by, 1}))[0];
}

// rows of the pool are those of a scene of these points alone
void expect_splats(const SplatPool& pool, const TileIndex& tile, const ScenePoints& points,
                   const PointSplatOptions& options)
{
    const Splats all = *pool.scene().read(), alone = *SplatScene::create(test_device(), points, options)->read();
    const SplatPool::Place place = pool.places().at(tile);
    ASSERT_EQ(place.count, points.size());
    for (size_t i = 0; i < place.count; ++i) {
        const size_t row = place.first + i;
        ASSERT_EQ(all.position[row], alone.position[i]);
        ASSERT_EQ(all.normal[row], alone.normal[i]) << i;
        ASSERT_EQ(all.color[row], alone.color[i]);
        ASSERT_EQ(all.sigma_u[row], alone.sigma_u[i]);
        ASSERT_EQ(all.opacity[row], alone.opacity[i]);
        ASSERT_EQ(all.label[row], alone.label[i]);
    }
}

TEST(engine_splat, splats_of_tiles_are_those_of_scenes_of_their_points)
{
    const auto pool = pool_of(1u << 20);
    const PointSplatOptions spaced{.auto_sigma = true}, wide{.auto_sigma = true, .neighbor_radius = 0.9f};
    const ScenePoints tiles[] = {floor_at(0, 300), floor_at(4, 500), floor_at(8, 17), floor_at(12, 256)};
    for (int32_t i = 0; i < 4; ++i)
        add(*pool, {i, 0}, tiles[i], i == 1 ? wide : spaced);
    for (int32_t i = 0; i < 4; ++i)
        expect_splats(*pool, {i, 0}, tiles[i], i == 1 ? wide : spaced);
}

TEST(engine_splat, a_picture_costs_by_the_splats_that_are_there)
{
    std::vector<SplatImage> images[2];
    uint64_t bytes[2][2] = {}, workgroups[2] = {};
    for (const int large : {0, 1}) {
        const auto pool = pool_of(large ? 64u << 20 : 1u << 20);
        const auto rasterizer_now = [&] {
            return *Rasterizer::create(test_device(), pool->scene(), 64, 48, 1, {.rows = pool->end()});
        };
        add(*pool, {0, 0}, floor_at(0, 3000));
        show(*pool);
        bytes[large][0] = rasterizer_now()->planned_bytes();
        add(*pool, {1, 0}, floor_at(4, 3000));
        show(*pool);
        const auto rasterizer = rasterizer_now();
        EXPECT_GE(rasterizer->rows(), 6000u);
        const SplatCamera seen_by = camera_above();
        images[large] = *rasterizer->render({&seen_by, 1});
        bytes[large][1] = rasterizer->planned_bytes();
        for (const Pass& pass : rasterizer->executable().plan().passes)
            workgroups[large] += uint64_t(pass.group_count[0]) * pass.group_count[1] * pass.group_count[2];
    }
    EXPECT_EQ(bytes[0][0], bytes[1][0]);
    EXPECT_EQ(bytes[0][1], bytes[1][1]);
    EXPECT_GT(bytes[0][1], bytes[0][0]);
    EXPECT_EQ(workgroups[0], workgroups[1]);
    EXPECT_EQ(images[0][0].color, images[1][0].color);
    EXPECT_EQ(images[0][0].label, images[1][0].label);
    EXPECT_GT(std::ranges::count(images[0][0].label, 2u), 0);
}

TEST(engine_splat, what_is_made_is_seen_when_it_is_shown_and_what_was_there_stays_until_then)
{
    const auto pool = pool_of(1u << 20);
    add(*pool, {0, 0}, floor_at(0, 400));
    EXPECT_EQ(pool->end(), 0u);
    EXPECT_EQ(blocks_of(*pool)[0], 0u);
    show(*pool);
    EXPECT_EQ(pool->end(), 448u); // whole blocks
    EXPECT_EQ(pool->version(), 1u);
    const SplatImage before = picture_of(*pool);
    EXPECT_GT(std::ranges::count(before.label, 2u), 0);

    ScenePoints changed = floor_at(0, 400);
    changed.labels.assign(changed.size(), 5);
    add(*pool, {0, 0}, changed); // again, of other points
    EXPECT_EQ(picture_of(*pool).label, before.label);
    EXPECT_EQ(pool->splats(), 400u);
    show(*pool);
    const SplatImage after = picture_of(*pool);
    EXPECT_GT(std::ranges::count(after.label, 5u), 0);
    EXPECT_EQ(std::ranges::count(after.label, 2u), 0);
    EXPECT_EQ(pool->places().at({0, 0}).first, 448u);
    expect_splats(*pool, {0, 0}, changed, {});

    add(*pool, {1, 0}, floor_at(4, 400)); // where the old ones were
    EXPECT_EQ(pool->places().at({1, 0}).first, 0u);
    pool->remove({1, 0}); // before it was ever shown
    pool->remove({0, 0});
    show(*pool);
    EXPECT_EQ(pool->end(), 0u);
    EXPECT_EQ(pool->splats(), 0u);
    EXPECT_EQ(picture_of(*pool).alpha, std::vector<float>(64 * 48, 0));
    const uint64_t version = pool->version();
    show(*pool);
    EXPECT_EQ(pool->version(), version);
}

TEST(engine_splat, updates_that_were_not_submitted_are_recorded_again)
{
    const auto pool = pool_of(1u << 20);
    add(*pool, {0, 0}, floor_at(0, 400));
    ASSERT_TRUE(pool->publish());
    const auto lost = *CommandRing::create(test_device(), 1);
    ASSERT_TRUE(pool->record_updates(*lost->begin()));
    EXPECT_EQ(pool->end(), 0u);
    EXPECT_EQ(pool->version(), 0u);
    pool->remove({0, 0}); // it may be shown by then
    add(*pool, {1, 0}, floor_at(4, 300));
    EXPECT_EQ(pool->places().at({1, 0}).first, 448u);
    show(*pool);
    EXPECT_EQ(pool->end(), 768u);
    EXPECT_EQ(blocks_of(*pool)[0], 0u);
    expect_splats(*pool, {1, 0}, floor_at(4, 300), {});
    add(*pool, {0, 0}, floor_at(0, 400));
    EXPECT_EQ(pool->places().at({0, 0}).first, 0u);
    show(*pool);
    expect_splats(*pool, {0, 0}, floor_at(0, 400), {});
}

TEST(engine_splat, rows_that_left_are_used_again_when_no_draw_looks_at_them)
{
    const auto pool = pool_of(512 * SplatPool::kSplatBytes);
    const ScenePoints points = floor_at(0, 300), more = floor_at(4, 300);
    add(*pool, {0, 0}, points);
    EXPECT_EQ(*pool->add({1, 0}, more, more.size(), {}), SplatPool::Room::none);
    EXPECT_EQ(*pool->add({1, 0}, floor_at(0, 513), 513, {}), SplatPool::Room::none);
    pool->remove({0, 0}); // never shown
    add(*pool, {0, 0}, points);
    show(*pool);
    pool->remove({0, 0});
    EXPECT_EQ(*pool->add({1, 0}, more, more.size(), {}), SplatPool::Room::later);
    ASSERT_TRUE(pool->publish());
    EXPECT_EQ(*pool->add({1, 0}, more, more.size(), {}), SplatPool::Room::later);
    Device& device = test_device();
    const auto ring = *CommandRing::create(device, 1);
    ASSERT_TRUE(pool->record_updates(*ring->begin()));
    pool->updates_are_submitted(device.next_point());
    EXPECT_EQ(*pool->add({1, 0}, more, more.size(), {}), SplatPool::Room::later); // a frame is on its way
    ASSERT_TRUE(device.wait(*ring->submit()));
    add(*pool, {1, 0}, more);
    show(*pool);

    // with no room for both, those of before leave first
    EXPECT_EQ(*pool->add({1, 0}, points, points.size(), {}), SplatPool::Room::later);
    EXPECT_FALSE(pool->has({1, 0}));
    show(*pool);
    add(*pool, {1, 0}, points);
    show(*pool);
    expect_splats(*pool, {1, 0}, points, {});
}

} // namespace engine_splat_test
} // namespace semrover
