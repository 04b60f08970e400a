// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/camera/rig.h"
#include "engine/splat/rasterizer.h"
#include "tests/support/kernel_case.h"
#include "tests/support/scratch_folder.h"
#include "tools/trajectory/camera_path.h"
#include "tools/trajectory/camera_text.h"

namespace semrover {
namespace engine_camera_render_test {

SplatScene make_scene(Device& device, const Splats& splats)
{
    auto scene = SplatScene::create(device, splats);
    SR_ASSERT(bool(scene), "{}", scene.error().message);
    return std::move(*scene);
}

void add(Splats& s, const std::array<float, 3>& position, const std::array<float, 3>& normal, float sigma,
         const std::array<float, 3>& color)
{
    s.position.push_back(position);
    s.normal.push_back(normal);
    s.color.push_back(color);
    s.sigma_u.push_back(sigma);
    s.sigma_v.push_back(sigma);
    s.opacity.push_back(1);
    s.label.push_back(uint8_t(s.label.size() % 20));
}

// the faces of a cube of edge 2 around (4, 0.5, 0.25) that look to the origin's side: -x red, +y green, +z blue
Splats cube()
{
    Splats s;
    for (int i = -20; i <= 20; ++i)
        for (int j = -20; j <= 20; ++j) {
            const float a = float(i) / 20, b = float(j) / 20;
            add(s, {3, 0.5f + a, 0.25f + b}, {-1, 0, 0}, 0.03f, {1, 0, 0});
            add(s, {4 + a, 1.5f, 0.25f + b}, {0, 1, 0}, 0.03f, {0, 1, 0});
            add(s, {4 + a, 0.5f + b, 1.25f}, {0, 0, 1}, 0.03f, {0, 0, 1});
        }
    return s;
}

SplatImage render(const SplatScene& scene, const CameraFrame& frame)
{
    const Intrinsics& k = frame.intrinsics;
    auto rasterizer = Rasterizer::create(test_device(), scene, k.width, k.height, 1, {.model = k.model});
    SR_ASSERT(bool(rasterizer), "{}", rasterizer.error().message);
    const SplatCamera camera = splat_camera(k, frame.pose);
    auto images = (*rasterizer)->render({&camera, 1});
    SR_ASSERT(bool(images), "{}", images.error().message);
    return std::move(images->front());
}

// the camera stands at (0, 2.5, 2) and looks along +x: the middle of each face is where it belongs, in its colour
void expect_cube(const SplatImage& image, const CameraFrame& frame)
{
    const std::array<Point3, 3> middles = {Point3{3, 0.5, 0.25}, {4, 1.5, 0.25}, {4, 0.5, 1.25}};
    for (size_t face = 0; face < 3; ++face) {
        const auto at = project(frame, middles[face]);
        ASSERT_TRUE(at);
        const size_t i = size_t(at->y) * image.width + size_t(at->x);
        EXPECT_GT(image.alpha[i], 0.9) << face;
        for (size_t c = 0; c < 3; ++c)
            EXPECT_NEAR(image.color[3 * i + c], c == face ? 1 : 0, 0.1) << face;
        if (face == 0) { // the others are seen flat, and few pixels hold metres of them
            EXPECT_NEAR(image.depth_expected[i], at->depth, 0.1); // which changes by 7 cm a pixel in the panorama
        }
    }
    const auto beside = project(frame, {4, 5.5, 0.25});
    ASSERT_TRUE(beside && beside->x > 0 && beside->x < image.width);
    EXPECT_EQ(image.alpha[size_t(beside->y) * image.width + size_t(beside->x)], 0);
}

// each file by hand, from the specification of its format: the same pose and field of view, so the same picture
TEST(engine_camera_render, a_cube_is_the_same_picture_from_every_format)
{
    const ScratchFolder folder;
    const Intrinsics view = pinhole_from_fov(90, 96, 72);
    std::filesystem::create_directory(folder / "sparse");
    folder.put("sparse/cameras.txt", "1 PINHOLE 96 72 48 48 48 36\n");
    // world to camera: R = rows (0 -1 0) (0 0 -1) (1 0 0), t = -R c = (2.5, 2, 0)
    folder.put("sparse/images.txt", "1 0.5 0.5 -0.5 0.5 2.5 2 0 1 a.png\n\n");
    const Path files[] = {
        folder.put("a.tum", "0 0 2.5 2 -0.5 0.5 -0.5 0.5\n"), folder.put("poses.txt", "0 0 1 0 -1 0 0 2.5 0 -1 0 2\n"),
        folder.put("transforms.json", R"({"w":96,"h":72,"fl_x":48,"fl_y":48,"cx":48,"cy":36,"camera_model":"OPENCV",
            "frames":[{"file_path":"a.png","transform_matrix":[[0,0,-1,0],[-1,0,0,2.5],[0,1,0,2],[0,0,0,1]]}]})"),
        folder.put("camera_path.json", R"({"camera_type":"perspective","render_height":72,"render_width":96,"fps":24,
            "camera_path":[{"camera_to_world":[0,0,-1,0,-1,0,0,2.5,0,1,0,2,0,0,0,1],"fov":73.73979529168804,"aspect":1.33}]})"),
        folder / "sparse"};
    const SplatScene scene = make_scene(test_device(), cube());
    std::optional<SplatImage> first;
    for (const Path& file : files) {
        SCOPED_TRACE(file.filename());
        const auto path = read_camera_path(file, view);
        ASSERT_TRUE(path) << path.error().message;
        const SplatImage image = render(scene, path->frames[0]);
        expect_cube(image, path->frames[0]);
        if (!first)
            first = image;
        double worst = 0;
        for (size_t i = 0; i < image.color.size(); ++i)
            worst = std::max(worst, std::abs(double(image.color[i]) - first->color[i]));
        EXPECT_LT(worst, 2e-3);
    }
}

TEST(engine_camera_render, a_cube_stands_where_each_lens_says)
{
    const ScratchFolder folder;
    const SplatScene scene = make_scene(test_device(), cube());
    Intrinsics opencv = pinhole_from_fov(90, 160, 120), fisheye = fisheye_from_fov(200, 160, 160);
    opencv.model = CameraModel::opencv;
    opencv.distortion = {-0.2, 0.04, 0.003, -0.002};
    fisheye.distortion = {0.02, -0.01};
    const Path pose = folder.put("a.tum", "0 0 2.5 2 -0.5 0.5 -0.5 0.5\n");
    Intrinsics prism = opencv;
    prism.distortion = {-0.2, 0.04, 0.003, -0.002, 0, 0, 0, 0, 0.01, -0.004, -0.02, 0.005};
    const Intrinsics ftheta{
        1, 1, 80.5, 59.5, 160, 120, CameraModel::ftheta, {1 / 70.0, 0, 1e-7, 0, 0, 1.01, 0.003, -0.004, 1.3, 1}};
    for (const Intrinsics& k :
         {pinhole_from_fov(90, 160, 120), opencv, prism, ftheta, fisheye, whole_sphere(300, 150)}) {
        SCOPED_TRACE(name_of(k.model));
        const auto path = read_camera_path(pose, k);
        ASSERT_TRUE(path) << path.error().message;
        expect_cube(render(scene, path->frames[0]), path->frames[0]);
    }
}

// a vehicle that turns and goes at 20 m/s, a shutter of 50 ms each way: the middle of each face is where the line is
// that sees it
TEST(engine_camera_render, a_cube_leans_as_a_rolling_shutter_has_it)
{
    const SplatScene scene = make_scene(test_device(), cube());
    for (const Intrinsics& k :
         {pinhole_from_fov(90, 160, 120), fisheye_from_fov(200, 320, 320), whole_sphere(600, 300)})
        for (const ShutterDirection direction :
             {ShutterDirection::down, ShutterDirection::up, ShutterDirection::right}) {
            SCOPED_TRACE(fmt::format("{} {}", name_of(k.model), name_of(direction)));
            CameraFrame frame;
            frame.intrinsics = k;
            const Rigid look = {0, 0, 1, 0, -1, 0, 0, 2.5, 0, -1, 0, 2, 0, 0, 0, 1};
            const auto pose = [&](double s) {
                const double yaw = 0.5 * s;
                return compose(Rigid{std::cos(yaw), -std::sin(yaw), 0, 20 * s, std::sin(yaw), std::cos(yaw), 0, 0, 0, 0,
                                     1, 0, 0, 0, 0, 1},
                               look);
            };
            frame.readout = Readout{direction, {inverse(pose(-0.025))}, {inverse(pose(0.025))}};
            auto rasterizer = Rasterizer::create(test_device(), scene, k.width, k.height, 1,
                                                 {.model = drawn_model(k.model, true), .moving = true});
            ASSERT_TRUE(rasterizer) << rasterizer.error().message;
            const SplatCamera camera = splat_camera(frame, true);
            const auto images = (*rasterizer)->render({&camera, 1});
            ASSERT_TRUE(images) << images.error().message;
            expect_cube(images->front(), frame);
        }
}

// docs/method.md §5.4: at no speed a rolling shutter gives the bytes of a global one
TEST(engine_camera_render, a_rolling_shutter_that_stands_is_a_global_one)
{
    const ScratchFolder folder;
    const SplatScene scene = make_scene(test_device(), cube());
    const Path drive = folder.put("a.tum", "0 0.1 2.2 1.7 0.01 0.02 0.3 0.95\n1 0.1 2.2 1.7 0.01 0.02 0.3 0.95\n");
    for (const std::string lens :
         {R"("width":160,"height":120,"fov":90)", R"("width":160,"height":160,"fov":200,"model":"fisheye")"}) {
        std::vector<std::vector<float>> colors;
        for (const std::string shutter : {"", R"("shutter":{"direction":"down","start":-5000,"readout":30000},)"}) {
            const auto rig =
                read_rig(folder.put("rig.json", R"({"path_axes":"vehicle","sensors":[{"name":"a",)" + shutter + lens +
                                                    R"(,"sensor_to_vehicle":{"translation":[0.3,0.1,
                0.2],"rotation":[-0.51,0.49,-0.5,0.5]}}]})"));
            ASSERT_TRUE(rig) << rig.error().message;
            const auto path = expand_rig(*rig, *read_tum(drive, pinhole_from_fov(90, 8, 8)));
            ASSERT_TRUE(path) << path.error().message;
            for (const CameraFrame& frame : path->frames) {
                EXPECT_EQ(frame.readout.has_value(), !shutter.empty());
                ASSERT_FALSE(frame.moves());
                const Intrinsics& k = frame.intrinsics;
                auto rasterizer = Rasterizer::create(test_device(), scene, k.width, k.height, 1, {.model = k.model});
                ASSERT_TRUE(rasterizer);
                const SplatCamera camera = splat_camera(frame, false);
                const auto images = (*rasterizer)->render({&camera, 1});
                ASSERT_TRUE(images);
                colors.push_back(images->front().color);
            }
        }
        for (const auto& c : colors)
            EXPECT_EQ(c, colors[0]);
    }
}

TEST(engine_camera_render, cameras_that_do_not_fit_together_are_drawn_in_turns)
{
    auto device = Device::create({.limits = "range=524288"}); // room for 131072 pairs
    ASSERT_TRUE(device) << device.error().message;
    Splats wall; // 1100 of them over all 16 tiles of each of 8 cameras
    for (int i = 0; i < 1100; ++i)
        add(wall, {0, 0, 2 + 0.01f * float(i)}, {0, 0, -1}, 12, {1, float(i % 2), 0});
    for (const CameraModel model : {CameraModel::pinhole, CameraModel::opencv}) {
        Intrinsics k = pinhole_from_fov(90, 64, 64);
        k.model = model;
        const SplatCamera camera = splat_camera(k, {});
        const SplatScene scene = make_scene(**device, wall);
        const std::vector<SplatCamera> many(8, camera);
        auto together = Rasterizer::create(**device, scene, 64, 64, 8, {.model = model}),
             one = Rasterizer::create(**device, scene, 64, 64, 1, {.model = model});
        ASSERT_TRUE(together && one);
        const auto images = (*together)->render(many);
        ASSERT_TRUE(images) << images.error().message;
        ASSERT_EQ(images->size(), many.size());
        const auto alone = (*one)->render({&camera, 1});
        for (const SplatImage& image : *images)
            ASSERT_EQ(image.color, alone->front().color);
    }
}

TEST(engine_camera_render, lenses_of_a_panorama_and_of_turns_agree)
{
    const SplatScene scene = make_scene(test_device(), cube());
    const Intrinsics k = whole_sphere(128, 64);
    std::vector<SplatCamera> cameras;
    for (int i = 0; i < 3; ++i)
        cameras.push_back(splat_camera(k, {{0, -1, 0, 2.5 - 0.2 * i, 0, 0, -1, 2, 1, 0, 0, 0, 0, 0, 0, 1}}));
    auto at_once = Rasterizer::create(test_device(), scene, 128, 64, 3, {.max_pairs = 64, .model = k.model}),
         in_turns = Rasterizer::create(test_device(), scene, 128, 64, 1, {.model = k.model});
    ASSERT_TRUE(at_once && in_turns);
    const auto a = (*at_once)->render(cameras), b = (*in_turns)->render(cameras);
    ASSERT_TRUE(a && b);
    EXPECT_GT((*at_once)->rebuilds(), 0u);
    for (size_t i = 0; i < 3; ++i) {
        EXPECT_EQ((*a)[i].color, (*b)[i].color);
        EXPECT_EQ((*a)[i].cell, (*b)[i].cell);
    }
}

} // namespace engine_camera_render_test
} // namespace semrover
