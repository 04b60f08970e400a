// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/trace/tracer.h"

#include "engine/format/image.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace semrover {

namespace {

using View = std::array<std::array<float, 4>, 8>; // shaders/lib/view.glsl

View view_of(const CameraFrame& frame, const Daylight& light)
{
    const Intrinsics& k = frame.intrinsics;
    const Rigid& m = frame.pose.world_to_camera;
    const Point3 origin = translation_of(frame.pose.camera_to_world());
    View v{};
    v[0] = {float(k.fx), float(k.fy), float(k.cx), float(k.cy)};
    for (size_t a = 0; a < 3; ++a)
        v[1 + a] = {float(m[4 * a]), float(m[4 * a + 1]), float(m[4 * a + 2]), float(origin[a])};
    const double flat = std::cos(light.sun_elevation), up = std::sin(light.sun_elevation);
    v[4] = {float(flat * std::cos(light.sun_azimuth)), float(flat * std::sin(light.sun_azimuth)), float(up), 0.0025f};
    // lower suns are redder and weaker: one air mass takes 1/e^0.1 of red, more of blue
    const double air = 1 / std::max(up, 0.1), level = 4.6 * (1 - 0.35 * light.cloud_cover);
    v[5] = {float(level * std::exp(-0.10 * air)), float(level * 0.97 * std::exp(-0.13 * air)),
            float(level * 0.93 * std::exp(-0.19 * air)), float(light.cloud_cover)};
    v[6] = {float(light.exposure), 1.12f, float(light.cloud_seed), float(light.haze)};
    return v;
}

uint8_t direction_byte(uint32_t packed, uint32_t component)
{
    return uint8_t(std::lround(128 + double(int8_t(packed >> (8 * component)))));
}

} // namespace

Daylight daylight_of_seed(uint64_t seed)
{
    uint64_t state = seed * 0x9e3779b97f4a7c15u + 0x2545f4914f6cdd1du;
    const auto next = [&state] {
        state ^= state >> 29;
        state *= 0xbf58476d1ce4e5b9u;
        state ^= state >> 32;
        return double(state >> 40) / 16777216.0;
    };
    Daylight d;
    d.sun_azimuth = next() * 6.283185307179586;
    d.sun_elevation = 0.55 + 0.5 * next();
    d.cloud_cover = 0.15 + 0.6 * next();
    d.cloud_seed = 400 * next();
    return d;
}

Status write_traced_image(const Path& folder, uint32_t number, const TracedImage& t)
{
    const std::string name = fmt::format("{:06}.png", number);
    for (const char* kind : {"color", "depth", "normal", "label", "instance", "visible"})
        SR_CHECK(make_folder(folder / kind));
    std::vector<uint16_t> depth, instance;
    for (const float metres : t.depth) // what 16 bits cannot hold is not measured
        depth.push_back(metres < 65.5345f ? uint16_t(std::lround(metres * 1000.f)) : uint16_t(0));
    for (const uint32_t thing : t.instance) {
        if (thing > UINT16_MAX)
            return fail(ErrorCode::bad_input, "{}: a picture of instances holds numbers up to {}, found {}",
                        quote_path(folder / "instance" / name), UINT16_MAX, thing);
        instance.push_back(uint16_t(thing));
    }
    SR_CHECK(write_png_rgb8(folder / "color" / name, t.width, t.height, t.color));
    SR_CHECK(write_png_gray16(folder / "depth" / name, t.width, t.height, depth));
    SR_CHECK(write_png_rgb8(folder / "normal" / name, t.width, t.height, t.normal));
    SR_CHECK(write_png_gray8(folder / "label" / name, t.width, t.height, t.label));
    SR_CHECK(write_png_gray16(folder / "instance" / name, t.width, t.height, instance));
    return write_png_gray8(folder / "visible" / name, t.width, t.height, t.visible);
}

Result<std::unique_ptr<Tracer>> Tracer::create(Device& device, const DeviceTraceScene& scene,
                                               const ShadeOptions& options)
{
    std::unique_ptr<Tracer> t(new Tracer(device));
    t->options_ = options;
    t->view_ = t->memory_.tensor(sizeof(View) / 16, 4, DType::f32, "view", 4);
    t->picture_ = t->memory_.tensor(options.width * options.height, 4, DType::u32, "picture", 4);
    SR_CHECK(t->memory_.allocate(device, "traced picture"));
    Graph g(device.limits());
    g.keep(shade(g, scene.in(g), t->view_.in(g), options), t->picture_);
    SR_TRY(t->executable_, Executable::create(device, g));
    return t;
}

Result<TracedImage> Tracer::render(const CameraFrame& frame, const Daylight& light)
{
    const View view = view_of(frame, light);
    SR_CHECK(view_.write(device_, std::span(&view, 1)));
    SR_CHECK(executable_->run());
    using Pixel = std::array<uint32_t, 4>;
    SR_TRY(const std::vector<Pixel> pixels, picture_.read<Pixel>(device_));
    TracedImage image{.width = options_.width, .height = options_.height};
    for (const auto& [color, depth_bits, normal, label] : pixels) {
        const float depth = std::bit_cast<float>(depth_bits);
        for (uint32_t c = 0; c < 3; ++c) {
            image.color.push_back(uint8_t(color >> (8 * c)));
            image.normal.push_back(direction_byte(normal, c));
        }
        image.depth.push_back(depth);
        image.label.push_back(uint8_t(label));
        image.instance.push_back(label >> 8);
        image.visible.push_back(depth > 0 ? 255 : 0);
    }
    return image;
}

} // namespace semrover
