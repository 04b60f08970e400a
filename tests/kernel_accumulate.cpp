// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
// accumulate() against docs/method.md §6.5 in double, for every lens
#include "engine/camera/lens.h"
#include "engine/splat/camera_pair.h"
#include "kernels/picture.h"
#include "tests/support/kernel_case.h"

#include <cmath>
#include <optional>

namespace semrover {
namespace kernel_accumulate_test {

constexpr double kFar = 1e7; // metres, of what has no depth
constexpr Pose kHere{};

struct View {
    CameraFrame camera; // world to camera, where the world is the frame of the camera of `now`
    std::vector<uint8_t> pixels;
    std::vector<float> depth; // metres; 0: nothing
};

Intrinsics lens(CameraModel model, uint32_t width, uint32_t height)
{
    if (model == CameraModel::equirectangular)
        return whole_sphere(width, height);
    Intrinsics k{0.7 * width, 0.72 * width, width / 2.0 + 0.8, height / 2.0 - 0.6, width, height, model, {}};
    if (model == CameraModel::opencv)
        k.distortion = {-0.12, 0.03, 0.001, -0.0007, -0.004};
    if (model == CameraModel::fisheye)
        k.distortion = {-0.03, 0.012, -0.006, 0.0009};
    return k;
}

// a step forward and a turn
Pose moved(double forward, double aside, double turn)
{
    const double c = std::cos(turn), s = std::sin(turn);
    return {{c, 0, s, aside, 0, 1, 0, 0.02, -s, 0, c, forward}};
}

// depth of a street: ground 1.5 m below, walls at both sides, an end, a box before it, sky
double street_depth(const Lens& lens, const Pose& pose, const Point3& ray)
{
    const Rigid back = pose.camera_to_world();
    const Point3 from = transform(back, {0, 0, 0}), to = transform(back, ray);
    double nearest = kFar;
    const auto meet = [&](int axis, double where, auto within) {
        const double along = to[axis] - from[axis], t = (where - from[axis]) / along;
        const Point3 hit{from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1]),
                         from[2] + t * (to[2] - from[2])};
        if (t > 0 && within(hit))
            nearest = std::min(nearest, t);
    };
    meet(1, 1.5, [](const Point3&) { return true; });
    for (const double side : {-4.0, 5.0})
        meet(0, side, [](const Point3& p) { return p[1] > -3; });
    meet(2, 25, [](const Point3& p) { return p[1] > -5; });
    meet(2, 6, [](const Point3& p) { return p[0] > 0 && p[0] < 2 && p[1] > -0.5; });
    return nearest == kFar ? kFar : nearest * lens.depth(ray);
}

// where a camera is when a pixel is read
Pose pose_of(const CameraFrame& frame, double y)
{
    if (!frame.readout)
        return frame.pose;
    const Readout& r = *frame.readout;
    const double down = y / frame.intrinsics.height, share = r.direction == ShutterDirection::down ? down : 1 - down;
    return {inverse(interpolate(r.from.camera_to_world(), r.to.camera_to_world(), share))};
}

View view(const CameraFrame& frame, uint32_t seed)
{
    const Intrinsics& k = frame.intrinsics;
    View v{frame, {}, {}};
    std::mt19937 random(seed);
    const Lens lens(k);
    for (uint32_t y = 0; y < k.height; ++y)
        for (uint32_t x = 0; x < k.width; ++x) {
            for (int c = 0; c < 3; ++c)
                v.pixels.push_back(uint8_t(128 + 90 * std::sin(0.2 * x + 0.13 * y + c) + double(random() % 60) - 30));
            const auto ray = lens.ray(x + 0.5, y + 0.5);
            const double depth = ray ? street_depth(lens, pose_of(frame, y + 0.5), *ray) : kFar;
            v.depth.push_back(depth < 65 ? float(depth) : 0.f);
        }
    return v;
}

View view(const Intrinsics& k, const Pose& pose, uint32_t seed)
{
    CameraFrame frame;
    frame.pose = pose;
    frame.intrinsics = k;
    return view(frame, seed);
}

struct Reference { // of cameras that stand, or move while they are read out
    const View &now, &past;
    AccumulateOptions o;
    int width = int(o.width), height = int(o.height);
    CameraView to{now.camera}, from{past.camera};

    uint32_t at(int x, int y) const
    {
        if (o.lens == SplatLens::equirectangular)
            x = (x % width + width) % width;
        return uint32_t(std::clamp(y, 0, height - 1) * width + std::clamp(x, 0, width - 1));
    }
    static double metres(float depth) { return depth > 0 ? depth : kFar; }
    // none: too close to a decision for fp32 to be asked for it
    std::optional<bool> is_shared(const Projection& source, double depth) const
    {
        std::optional<bool> shared;
        for (const double dx : {-2e-3, 2e-3})
            for (const double dy : {-2e-3, 2e-3}) {
                const auto here = lies_between(source.x - 0.5 + dx, source.y - 0.5 + dy, depth);
                if (!here || (shared && *shared != *here))
                    return {};
                shared = here;
            }
        return shared;
    }
    // the depth between those of the four pixels around a place
    std::optional<bool> lies_between(double u, double v, double depth) const
    {
        const int x = int(std::floor(u)), y = int(std::floor(v));
        double nearest = 2 * kFar, farthest = 0;
        for (int i = 0; i < 4; ++i) {
            const double d = metres(past.depth[at(x + (i & 1), y + (i >> 1))]);
            nearest = std::min(nearest, d);
            farthest = std::max(farthest, d);
        }
        const double low = nearest * (1 - o.tolerance), high = farthest * (1 + o.tolerance), slack = 1e-3 * depth;
        if (std::abs(depth - low) < slack || std::abs(depth - high) < slack)
            return {};
        return depth >= low && depth <= high;
    }
    double sample(const Projection& p, int c) const
    {
        const double u = p.x - 0.5, v = p.y - 0.5;
        const int x = int(std::floor(u)), y = int(std::floor(v));
        double sum = 0;
        for (int j = -1; j <= 2; ++j)
            for (int i = -1; i <= 2; ++i)
                sum += kernel(u - x - i) * kernel(v - y - j) * past.pixels[3 * at(x + i, y + j) + size_t(c)];
        return sum;
    }
    // Catmull and Rom 1974; Keys 1981 with a = -1/2
    static double kernel(double t)
    {
        t = std::abs(t);
        return t < 1 ? 1.5 * t * t * t - 2.5 * t * t + 1 : t < 2 ? -0.5 * t * t * t + 2.5 * t * t - 4 * t + 2 : 0;
    }
    double clipped(double value, int x, int y, int c) const
    {
        double sum = 0, squares = 0;
        for (int j = -1; j <= 1; ++j)
            for (int i = -1; i <= 1; ++i) {
                const double near = now.pixels[3 * at(x + i, y + j) + size_t(c)];
                sum += near;
                squares += near * near;
            }
        const double mean = sum / 9, reach = o.spread * std::sqrt(std::max(0.0, squares / 9 - mean * mean));
        return std::clamp(value, mean - reach, mean + reach);
    }
    // of a pixel; none: undecided
    std::optional<std::array<double, 3>> color(int x, int y) const
    {
        const uint32_t pixel = at(x, y);
        std::array<double, 3> own{double(now.pixels[3 * pixel]), double(now.pixels[3 * pixel + 1]),
                                  double(now.pixels[3 * pixel + 2])};
        const auto point = to.surface(x + 0.5, y + 0.5, metres(now.depth[pixel]));
        if (!point)
            return own;
        const auto source = from.project(*point);
        const double edge = source ? std::min({source->x, source->y, width - source->x, height - source->y}) : -1.0;
        if (source && std::abs(edge) < 2e-3)
            return {};
        if (!source || edge < 0)
            return own;
        const auto shared = is_shared(*source, source->depth);
        if (!shared)
            return {};
        for (int c = 0; *shared && c < 3; ++c)
            own[size_t(c)] += o.share * (clipped(sample(*source, c), x, y, c) - own[size_t(c)]);
        return own;
    }
};

std::vector<uint32_t> words(const std::vector<uint8_t>& pixels, size_t count)
{
    std::vector<uint32_t> all(count);
    std::memcpy(all.data(), pixels.data(), pixels.size());
    return all;
}

// the op's bytes
std::vector<uint8_t> accumulated(const View& now, const View& past, const AccumulateOptions& o)
{
    KernelCase k(test_device());
    const size_t count = picture_words(o.width, o.height);
    const Tensor y = accumulate(k.graph, k.input(pair_of(now.camera, past.camera).rows, kLensCameraFloats),
                                {k.input(words(now.pixels, count)), k.input(now.depth)},
                                {k.input(words(past.pixels, count)), k.input(past.depth)}, o);
    const Tensor kept = k.graph.keep(y, k.output(uint32_t(count), 1, DType::u32, 1));
    const Status status = k.compile_and_run();
    EXPECT_TRUE(status) << status.error().message;
    const auto bytes = k.read_array<uint32_t>(kept);
    std::vector<uint8_t> pixels(now.pixels.size());
    std::memcpy(pixels.data(), bytes.data(), pixels.size());
    return pixels;
}

void expect_reference(const View& now, const View& past, float share)
{
    const auto [width, height] = std::pair(now.camera.intrinsics.width, now.camera.intrinsics.height);
    const CameraPair pair = pair_of(now.camera, past.camera);
    const AccumulateOptions o{
        .width = width, .height = height, .lens = lens_of(pair.model), .moving = pair.moving, .share = share};
    const std::vector<uint8_t> got = accumulated(now, past, o);
    const Reference reference{now, past, o};
    size_t undecided = 0, changed = 0;
    for (int y = 0; y < int(height); ++y)
        for (int x = 0; x < int(width); ++x) {
            const auto expected = reference.color(x, y);
            undecided += !expected;
            for (size_t c = 0; expected && c < 3; ++c) {
                const size_t at = 3 * (size_t(y) * width + size_t(x)) + c;
                changed += got[at] != now.pixels[at];
                ASSERT_NEAR(got[at], std::clamp((*expected)[c], 0.0, 255.0), 0.55) << x << ", " << y;
            }
        }
    EXPECT_LT(undecided, size_t(width) * height / 20 + 3);
    EXPECT_GT(changed, size_t(width) * height); // of three channels
}

TEST(kernel_accumulate, takes_a_share_of_what_the_frame_before_saw_of_the_same_surface)
{
    for (const CameraModel model :
         {CameraModel::pinhole, CameraModel::opencv, CameraModel::fisheye, CameraModel::equirectangular})
        for (const auto& [width, height] : {std::pair{131u, 67u}, {64u, 48u}}) {
            SCOPED_TRACE(fmt::format("lens {}, {} x {}", int(model), width, height));
            const Intrinsics k = lens(model, width, height);
            expect_reference(view(k, kHere, 1), view(k, moved(-0.31, 0.07, 0.013), 2), 0.6f);
            expect_reference(view(k, kHere, 1), view(k, moved(0.8, -0.2, -0.05), 2), 0.95f);
        }
}

TEST(kernel_accumulate, follows_the_lines_of_rolling_shutters)
{
    for (const CameraModel model :
         {CameraModel::pinhole, CameraModel::opencv, CameraModel::fisheye, CameraModel::equirectangular}) {
        SCOPED_TRACE(name_of(model));
        const auto rolling = [&](const Pose& from, const Pose& to, ShutterDirection direction) {
            CameraFrame frame;
            frame.pose = from;
            frame.intrinsics = lens(model, 131, 67);
            frame.readout = Readout{direction, from, to};
            return frame;
        };
        const View now = view(rolling(kHere, moved(0.4, 0.05, 0.02), ShutterDirection::down), 1),
                   past = view(rolling(moved(-0.6, -0.1, -0.03), moved(-0.3, -0.05, 0), ShutterDirection::up), 2),
                   still = view(lens(model, 131, 67), moved(-0.5, 0.1, 0.01), 3);
        expect_reference(now, past, 0.6f);
        expect_reference(now, still, 0.6f);
        expect_reference(still, past, 0.9f);
    }
}

TEST(kernel_accumulate, leaves_a_frame_alone_where_nothing_is_shared)
{
    const Intrinsics k = lens(CameraModel::pinhole, 37, 21);
    const View now = view(k, kHere, 1);
    View past = view(k, kHere, 2);
    const AccumulateOptions o{.width = 37, .height = 21, .share = 0.6f};
    EXPECT_NE(accumulated(now, past, o), now.pixels);
    for (float& depth : past.depth)
        depth = 0.1f; // something right before the camera
    EXPECT_EQ(accumulated(now, past, o), now.pixels);
    past = view(k, moved(0, 0, 2.5), 2); // looks back
    EXPECT_EQ(accumulated(now, past, o), now.pixels);
}

TEST(kernel_accumulate, cuts_the_frame_before_to_what_is_around_the_pixel)
{
    const Intrinsics k = lens(CameraModel::pinhole, 24, 16);
    View now = view(k, kHere, 1), past = view(k, kHere, 2);
    std::ranges::fill(now.pixels, uint8_t(100));
    std::ranges::fill(past.pixels, uint8_t(200));
    const AccumulateOptions o{.width = 24, .height = 16, .share = 0.6f};
    EXPECT_EQ(accumulated(now, past, o), now.pixels); // no spread around any pixel: nothing of another colour comes in
    AccumulateOptions wide = o;
    wide.spread = 1e9f;
    now.pixels[3 * (5 * 24 + 7)] = 101;                             // with the least spread
    EXPECT_EQ(accumulated(now, past, wide)[3 * (5 * 24 + 7)], 160); // 101 + 0.6 (200 - 101)
}

} // namespace kernel_accumulate_test
} // namespace semrover
