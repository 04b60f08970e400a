// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/fusion/depth_frames.h"
#include "engine/fusion/fuse.h"
#include "tests/support/kernel_case.h"
#include "tests/support/says.h"
#include "tests/support/street_scene.h"
#include "tools/fuse/frame_pictures.h"

#include <map>

namespace semrover {
namespace engine_fusion_test {

const StreetScene kStreet;

const FusionOptions kOptions{.max_depth = 12};

double percentile(std::vector<double> values, double share)
{
    std::ranges::sort(values);
    return values[size_t(double(values.size() - 1) * share)];
}

bool same(const FusedMesh& a, const FusedMesh& b)
{
    return a.mesh.positions == b.mesh.positions && a.mesh.colors == b.mesh.colors && a.mesh.faces == b.mesh.faces &&
           a.mesh.face_labels == b.mesh.face_labels && a.views == b.views;
}

FusedMesh fused(const DepthFrames& frames, const FusionOptions& options = kOptions)
{
    auto result = fuse(test_device(), frames, options);
    EXPECT_TRUE(result) << result.error().message;
    return result ? std::move(*result) : FusedMesh{};
}

// edges by the number of faces on each side
std::map<std::pair<uint32_t, uint32_t>, std::pair<int, int>> edges_of(const Mesh& mesh)
{
    std::map<std::pair<uint32_t, uint32_t>, std::pair<int, int>> edges;
    for (const auto& face : mesh.faces)
        for (size_t i = 0; i < 3; ++i) {
            const uint32_t a = face[i], b = face[(i + 1) % 3];
            ++(a < b ? edges[{a, b}].first : edges[{b, a}].second);
        }
    return edges;
}

TEST(EngineFusion, a_street_is_within_5_cm_and_its_labels_are_right)
{
    const FusedMesh out = fused(kStreet.frames(StreetScene::drive(12)));
    std::vector<double> distances;
    for (size_t i = 0; i < out.mesh.positions.size(); ++i) {
        const auto& v = out.mesh.positions[i];
        if (out.views[i] >= 2)
            distances.push_back(std::abs(kStreet.distance({v[0], v[1], v[2]})));
    }
    ASSERT_GT(distances.size(), 10000u);
    RecordProperty("distance_95_percent", fmt::format("{:.4f} m", percentile(distances, 0.95)));
    EXPECT_LT(percentile(distances, 0.95), 0.05);
    size_t right = 0;
    std::map<uint8_t, size_t> seen;
    for (size_t f = 0; f < out.mesh.faces.size(); ++f) {
        Point3 middle{};
        for (const uint32_t v : out.mesh.faces[f])
            for (size_t axis = 0; axis < 3; ++axis)
                middle[axis] += double(out.mesh.positions[v][axis]) / 3;
        right += out.mesh.face_labels[f] == kStreet.label(middle);
        ++seen[out.mesh.face_labels[f]];
    }
    RecordProperty("labels_right", fmt::format("{} of {}", right, out.mesh.faces.size()));
    EXPECT_GE(double(right), 0.95 * double(out.mesh.faces.size()));
    for (const auto& shape : kStreet.shapes)
        EXPECT_GT(seen[shape.label], 100u) << int(shape.label);
    EXPECT_EQ(seen.count(10), 0u) << "sky has no surface";
    const Status checked = check_mesh(out.mesh, "fused");
    EXPECT_TRUE(checked) << checked.error().message;
}

TEST(EngineFusion, every_edge_has_two_faces_with_opposite_directions_or_lies_on_the_border)
{
    const FusedMesh out = fused(kStreet.frames(StreetScene::drive(4)));
    size_t border = 0, inside = 0;
    for (const auto& [edge, faces] : edges_of(out.mesh)) {
        ASSERT_LE(faces.first, 1) << edge.first << " " << edge.second;
        ASSERT_LE(faces.second, 1) << edge.first << " " << edge.second;
        ++(faces.first + faces.second == 2 ? inside : border);
    }
    EXPECT_GT(inside, 20 * border);
}

TEST(EngineFusion, neither_runs_nor_chunks_nor_unused_frames_change_a_byte)
{
    std::vector<CameraFrame> cameras = StreetScene::drive(5);
    const FusedMesh once = fused(kStreet.frames(cameras));
    EXPECT_TRUE(same(once, fused(kStreet.frames(cameras))));
    FusionOptions chunked = kOptions;
    chunked.max_chunk_blocks = 201;
    const FusedMesh pieces = fused(kStreet.frames(cameras), chunked);
    EXPECT_GT(pieces.figures.chunks, 3u);
    EXPECT_TRUE(same(once, pieces));
    // a camera whose pictures are empty, far above
    cameras.insert(cameras.begin() + 2, StreetScene::camera({0, 0, 100}, 0, -1.5, cameras[0].intrinsics));
    EXPECT_EQ(fused(kStreet.frames(cameras)).mesh.positions, once.mesh.positions);
}

TEST(EngineFusion, a_scene_far_from_the_origin_is_as_good)
{
    StreetScene far = kStreet;
    std::vector<CameraFrame> cameras = StreetScene::drive(3);
    const Point3 shift = {6000, -4000, 100};
    for (StreetScene::Shape& s : far.shapes)
        for (size_t axis = 0; axis < 3; ++axis)
            s.at[axis] += shift[axis];
    for (CameraFrame& c : cameras) {
        Rigid m = c.pose.camera_to_world();
        for (size_t axis = 0; axis < 3; ++axis)
            m[axis * 4 + 3] += shift[axis];
        c.pose.world_to_camera = inverse(m);
    }
    const FusedMesh here = fused(kStreet.frames(StreetScene::drive(3))), there = fused(far.frames(cameras));
    std::vector<double> distances;
    for (const auto& v : there.mesh.positions)
        distances.push_back(std::abs(far.distance({v[0], v[1], v[2]})));
    EXPECT_LT(percentile(distances, 0.95), 0.05);
    EXPECT_NEAR(double(there.mesh.positions.size()), double(here.mesh.positions.size()),
                0.02 * double(here.mesh.positions.size()));
}

TEST(EngineFusion, cameras_of_several_sizes_and_excluded_classes)
{
    std::vector<CameraFrame> cameras = StreetScene::drive(3);
    for (const CameraFrame& c : StreetScene::drive(3, 101, 77))
        cameras.push_back(c);
    FusionOptions options = kOptions;
    options.excluded |= 1u << 13;
    const FusedMesh out = fused(kStreet.frames(cameras), options);
    EXPECT_EQ(std::ranges::count(out.mesh.face_labels, 13), 0);
    EXPECT_GT(std::ranges::count(out.mesh.face_labels, 0), 1000);
    EXPECT_GT(std::ranges::count(fused(kStreet.frames(cameras)).mesh.face_labels, 13), 100);
}

TEST(EngineFusion, without_labels_and_colours_the_mesh_is_gray_and_unlabelled)
{
    std::vector<CameraFrame> cameras = StreetScene::drive(2);
    DepthFrames frames = kStreet.frames(cameras);
    frames.load = [load = frames.load](size_t i) -> Result<DepthImages> {
        SR_TRY(DepthImages images, load(i));
        images.labels.clear();
        images.colors.clear();
        return images;
    };
    const FusedMesh out = fused(frames);
    EXPECT_EQ(out.figures.unlabelled_faces, out.mesh.faces.size());
    for (const auto& color : out.mesh.colors)
        ASSERT_EQ(color, (std::array<uint8_t, 3>{128, 128, 128}));
}

TEST(EngineFusion, what_one_frame_saw_is_dropped_unless_asked_for)
{
    const DepthFrames frames = kStreet.frames(StreetScene::drive(1));
    EXPECT_TRUE(says(fuse(test_device(), frames, kOptions), "no surface was seen by 2 of them (`min_views`)"));
    FusionOptions lenient = kOptions;
    lenient.min_views = 1;
    EXPECT_GT(fused(frames, lenient).mesh.faces.size(), 1000u);
}

TEST(EngineFusion, poses_that_cannot_be_and_empty_pictures_are_bad_input)
{
    std::vector<CameraFrame> cameras = StreetScene::drive(2);
    EXPECT_TRUE(says(fuse(test_device(), StreetScene{.shapes = {}}.frames(cameras), kOptions),
                     "nothing was observed: no pixel of 2 frames has a depth within 12 m"));
    cameras[1] = StreetScene::camera({1e5, 0, 1.6}, 0, 0.1, cameras[0].intrinsics);
    EXPECT_TRUE(
        says(fuse(test_device(), kStreet.frames(cameras), kOptions), "frame 1 is 100000 m from frame 0 along x"));
    cameras[0] = StreetScene::camera({1, 3e6, 1.6}, 0, 0.1, cameras[0].intrinsics);
    EXPECT_TRUE(says(fuse(test_device(), kStreet.frames(cameras), kOptions), "frame 0 is at (1, 3e+06, 1.6) m"));
    std::vector<CameraFrame> wide = StreetScene::drive(2);
    wide[1] = StreetScene::camera({9000, 9000, 900}, 0, 0.1, wide[0].intrinsics);
    FusionOptions fine = kOptions;
    fine.voxel = 0.02;
    EXPECT_TRUE(says(fuse(test_device(), kStreet.frames(wide), fine), "use a larger `voxel`"));
}

TEST(EngineFusion, pixels_of_other_sizes_meet_at_their_centres)
{
    const std::vector<uint8_t> wide = {1, 2, 3, 4, 5, 6};
    EXPECT_EQ(nearest_pixels(wide, {6, 1}, {2, 1}), (std::vector<uint8_t>{2, 5}));
    EXPECT_EQ(nearest_pixels(wide, {3, 2}, {6, 2}), (std::vector<uint8_t>{1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6}));
    EXPECT_EQ(nearest_pixels(wide, {6, 1}, {6, 1}), wide);
    // the mean of light: half of black and white is 188
    const ImageRgb8 checks{4, 1, {0, 0, 0, 255, 255, 255, 10, 20, 30, 10, 20, 30}};
    EXPECT_EQ(resampled(checks, {2, 1}).pixels, (std::vector<uint8_t>{188, 188, 188, 10, 20, 30}));
    EXPECT_EQ(resampled(checks, {4, 1}).pixels, checks.pixels);
    EXPECT_EQ(resampled(checks, {8, 1}).pixels[3], 0);
    EXPECT_EQ(resampled(checks, {8, 1}).pixels[6], 255);
    EXPECT_EQ(resampled(checks, {3, 1}).pixels, (std::vector<uint8_t>{0, 0, 0, 188, 188, 189, 10, 20, 30}));
    EXPECT_TRUE(same_view({1296, 968}, {640, 480})); // ScanNet
    EXPECT_FALSE(same_view({1920, 1080}, {640, 480}));
}

TEST(EngineFusion, times_are_associated_the_closest_first_and_each_once)
{
    using Pairs = std::vector<std::pair<size_t, size_t>>;
    const std::vector<double> a = {0, 0.033, 0.066, 1}, b = {-0.019, 0.012, 0.031, 0.052, 0.9801, 1.1};
    EXPECT_EQ(*associate_times(a, b), (Pairs{{0, 1}, {1, 2}, {2, 3}, {3, 4}}));
    // 0.033 is 0.019 from both; the pair of 0.066 is closer
    EXPECT_EQ(*associate_times(std::vector<double>{0.033, 0.066}, std::vector<double>{0.052}), (Pairs{{1, 0}}));
    EXPECT_TRUE(associate_times(a, {})->empty());
    const std::vector<double> same(3000, 5.0);
    EXPECT_TRUE(says(associate_times(same, same), "more than 4194304 pairs of times are within 0.02 s"));
}

} // namespace engine_fusion_test
} // namespace semrover
