// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/camera/lens.h"
#include "engine/format/flow_picture.h"
#include "engine/format/image.h"
#include "engine/splat/rasterizer.h"
#include "kernels/picture.h"
#include "tests/support/kernel_case.h"

namespace semrover {
namespace kernel_flow_test {

constexpr uint32_t kWidth = 61, kHeight = 37;

struct FlowPixel {
    double u = 0, v = 0;
    FlowState state = FlowState::nothing;
    bool near_border = false; // of two states: single precision may find the other
};

// a picture's depths, of which the next has its own; a pixel of a mover has its number + 1
struct FlowScene {
    std::vector<double> depth, next_depth;
    std::vector<uint32_t> movers;
    std::vector<Rigid> moves; // of what stands, then of movers
};

double farthest_around(const FlowScene& s, double x, double y, bool panorama)
{
    double farthest = 0;
    for (int i = 0; i < 4; ++i) {
        int64_t column = int64_t(std::floor(x - 0.5)) + (i & 1), row = int64_t(std::floor(y - 0.5)) + (i >> 1);
        column = panorama ? (column + kWidth) % kWidth : std::clamp<int64_t>(column, 0, kWidth - 1);
        row = std::clamp<int64_t>(row, 0, kHeight - 1);
        const double d = s.next_depth[size_t(row) * kWidth + size_t(column)];
        farthest = std::max(farthest, d > 0 ? d : 1e30);
    }
    return farthest;
}

// every pixel by itself, in double
FlowPixel reference(const FlowScene& s, const Lens& from, const Lens& to, bool panorama, size_t pixel)
{
    FlowPixel flow;
    const double x = double(pixel % kWidth) + 0.5, y = double(pixel / kWidth) + 0.5, depth = s.depth[pixel];
    const auto ray = from.ray(x, y);
    if (!(depth > 0) || !ray || !(from.depth(*ray) > 0))
        return flow;
    Point3 point = *ray;
    for (double& v : point)
        v *= depth / from.depth(*ray);
    const Rigid& move = s.moves[s.movers[pixel]];
    if (move == Rigid{}) {
        flow.state = FlowState::hidden;
        flow.u = flow.v = kUnknownFlow;
        return flow;
    }
    const Point3 next = transform(move, point);
    const auto there = to.project(next);
    flow.state = FlowState::outside;
    flow.u = flow.v = kUnknownFlow;
    if (!there || !(to.depth(next) > 0))
        return flow;
    flow.u = there->x - x;
    flow.v = there->y - y;
    if (panorama)
        flow.u -= kWidth * std::floor(flow.u / kWidth + 0.5);
    const double edge = std::min({there->x, there->y, kWidth - there->x, kHeight - there->y});
    flow.near_border = std::abs(edge) < 1e-3;
    if (edge < 0)
        return flow;
    const double limit = farthest_around(s, there->x, there->y, panorama) * 1.02, away = to.depth(next);
    const double fx = there->x - 0.5 - std::floor(there->x - 0.5), fy = there->y - 0.5 - std::floor(there->y - 0.5);
    flow.near_border =
        flow.near_border || std::abs(away - limit) < 1e-4 * away || std::min({fx, fy, 1 - fx, 1 - fy}) < 1e-3;
    flow.state = away > limit ? FlowState::hidden : FlowState::seen;
    return flow;
}

FlowScene random_scene(uint32_t seed)
{
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(0, 1);
    FlowScene s;
    for (uint32_t i = 0; i < kWidth * kHeight; ++i) {
        s.depth.push_back(unit(random) < 0.1 ? 0 : double(float(1.5 + 30 * unit(random))));
        s.next_depth.push_back(unit(random) < 0.1 ? 0 : double(float(1.5 + 30 * unit(random))));
        s.movers.push_back(unit(random) < 0.3 ? 1 + random() % 3 : 0);
    }
    const auto move = [](Point3 by, double turn) {
        return *rigid_from_quaternion(by, {0, std::sin(turn / 2), 0, std::cos(turn / 2)}, "move");
    };
    s.moves = {move({0.3, 0.02, -1.1}, 0.03), move({-1.5, 0, 2}, 0.2), move({0.1, 0, -3}, -0.4), Rigid{}};
    return s;
}

struct FlowRun {
    std::vector<float> flow;
    std::vector<uint32_t> states;
};

FlowRun run(const FlowScene& s, const Intrinsics& from, const Intrinsics& to)
{
    KernelCase k(test_device());
    std::vector<float> cameras(2 * kLensCameraFloats), moves, depth, next_depth;
    write_row(splat_camera(from, Pose()), std::span(cameras).first(kLensCameraFloats));
    write_row(splat_camera(to, Pose()), std::span(cameras).last(kLensCameraFloats));
    for (const Rigid& move : s.moves)
        for (size_t i = 0; i < 12; ++i)
            moves.push_back(float(move[i]));
    std::vector<uint32_t> owners;
    for (size_t i = 0; i < s.depth.size(); ++i) {
        depth.insert(depth.end(), {-1.f, float(s.depth[i])});
        next_depth.insert(next_depth.end(), {-1.f, float(s.next_depth[i])});
        owners.push_back(s.movers[i] ? 6 + s.movers[i] : uint32_t(i % 7 * 1000));
    }
    const FlowTensors y = splat_flow(k.graph, k.input(cameras, kLensCameraFloats),
                                     {k.input(moves, 12), k.input(std::vector<uint32_t>{0, 0, 0, 0, 0, 0, 0, 1, 2, 3})},
                                     {k.input(depth, 2), k.input(owners)}, k.input(next_depth, 2),
                                     {.width = kWidth, .height = kHeight, .lens = lens_of(from.model)});
    const Tensor flow = k.output(y.flow.rows, y.flow.cols, y.flow.dtype, y.flow.ld);
    const Tensor states = k.output(y.states.rows, y.states.cols, y.states.dtype, y.states.ld);
    k.graph.keep(y.flow, flow);
    k.graph.keep(y.states, states);
    const Status status = k.compile_and_run();
    EXPECT_TRUE(status) << status.error().message;
    return {k.read_array<float>(flow), k.read_array<uint32_t>(states)};
}

TEST(kernel_flow, matches_every_pixel_in_double_through_every_lens)
{
    Intrinsics zoomed = pinhole_from_fov(70, kWidth, kHeight);
    zoomed.fx *= 1.1;
    const std::pair<Intrinsics, Intrinsics> lenses[] = {
        {pinhole_from_fov(70, kWidth, kHeight), zoomed},
        {{40, 41, 30, 18, kWidth, kHeight, CameraModel::opencv, {-0.25, 0.06, 0.01, 0.002}},
         {40, 41, 30, 18, kWidth, kHeight, CameraModel::opencv, {-0.2, 0.06, 0.01, 0.002}}},
        {fisheye_from_fov(190, kWidth, kHeight), fisheye_from_fov(190, kWidth, kHeight)},
        {whole_sphere(kWidth, kHeight), whole_sphere(kWidth, kHeight)}};
    for (const auto& [from, to] : lenses) {
        SCOPED_TRACE(name_of(from.model));
        const bool panorama = from.model == CameraModel::equirectangular;
        const FlowScene s = random_scene(uint32_t(from.model));
        const FlowRun got = run(s, from, to);
        std::array<size_t, 4> states{};
        double worst = 0;
        for (size_t i = 0; i < got.states.size(); ++i) {
            const FlowPixel expect = reference(s, Lens(from), Lens(to), panorama, i);
            ++states[size_t(expect.state)];
            ASSERT_TRUE(got.states[i] == uint32_t(expect.state) || expect.near_border)
                << i << ": " << got.states[i] << ", not " << int(expect.state);
            if (expect.state == FlowState::nothing || expect.u > 1e9) {
                ASSERT_GT(got.flow[2 * i], 1e9);
                continue;
            }
            double across = got.flow[2 * i] - expect.u;
            if (panorama) // half a turn either way
                across -= kWidth * std::round(across / kWidth);
            const double size = 1 + std::hypot(expect.u, expect.v); // behind the camera flows have no bound
            worst = std::max(worst, std::hypot(across, got.flow[2 * i + 1] - expect.v) / size);
        }
        EXPECT_LE(worst, 1e-3);
        for (size_t state = 0; state < states.size(); ++state)
            EXPECT_EQ(states[state] > 20, !(panorama && state == 3)) << state; // nothing leaves a panorama
    }
}

TEST(kernel_flow, files_hold_what_their_formats_say)
{
    const std::vector<float> flow = {1.5f, -2.25f, 600, 0, kUnknownFlow, kUnknownFlow, -511.98f, 511.9f};
    const auto flo = encode_flow(FlowFormat::flo, 2, 2, flow, kPngLevel);
    ASSERT_TRUE(flo);
    ASSERT_EQ(flo->size(), 12 + 32u);
    EXPECT_EQ(std::memcmp(flo->data(), "PIEH\2\0\0\0\2\0\0\0", 12), 0);
    EXPECT_EQ(std::memcmp(flo->data() + 12, flow.data(), 32), 0);
    EXPECT_TRUE(encode_flow(FlowFormat::png, 2, 2, flow, kPngLevel)); // read by OpenCV: other_programs
}

} // namespace kernel_flow_test
} // namespace semrover
