// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// a surfel as a camera with a lens sees it, and the pixels that it can reach (research/splat.md, section 1.8): the disc
// lies in a sphere, that in a cone of rays, the cone in a box of pixels
#include "lib/lens.glsl"
#include "lib/splat_surfel.glsl"

layout(constant_id = 0) const uint kModel = 1;
layout(push_constant) uniform Push { SplatPush p; };
layout(binding = 0) readonly buffer Cameras { vec4 cameras[]; };     // [cameras, kCameraVectors]
layout(binding = 1) readonly buffer Positions { vec4 positions[]; }; // [splats] xyz, opacity
layout(binding = 2) readonly buffer Normals { vec4 normals[]; };     // [splats] xyz, sigma_u
layout(binding = 3) readonly buffer Colors { vec4 colors[]; };       // [splats] rgb, sigma_v

#include "lib/splat_camera.glsl"

struct LensView {
    vec3 center;   // camera frame, metres
    float away;    // |center|
    vec3 t_u, t_v; // unit
    vec3 normal;   // towards the camera
    vec2 pixel;    // of the centre; far off where the lens does not see it
    ivec4 bounds;  // first and last pixel in x, then in y; in a panorama first > last: from there on around to here
};

const float kNowhere = -1e9;

// pixels across a panorama whose centres lie within [low, high], which may run over its sides
ivec2 wrapped_range(float low, float high)
{
    const int width = int(p.width);
    const float margin = 0.05 + 1e-3 * (high - low);
    const int first = int(ceil(low - margin - 0.5)), last = int(floor(high + margin - 0.5));
    if (last - first + 1 >= width)
        return ivec2(0, width - 1);
    if (last < first)
        return ivec2(0, -1);
    return ivec2(first < 0 ? first + width : first >= width ? first - width : first,
                 last < 0 ? last + width : last >= width ? last - width : last);
}

// the largest x of radii [inner, outer] and directions within `spread` of `angle`
float sector_end(float angle, float spread, float inner, float outer)
{
    const float around = abs(angle - 2.0 * kPi * floor(angle / (2.0 * kPi) + 0.5)); // to the x axis
    const float along = accurate_cos(max(around - spread, 0.0));
    return along * (along > 0.0 ? outer : inner);
}

// low x and y, high x and y of the cone on the image of a lens around the z axis; false: wholly beyond its limit
bool sector_bounds(Lens l, LensView s, float half_angle, out vec4 box)
{
    const float across = length(s.center.xy), angle = accurate_atan2(across, s.center.z);
    float inner = max(angle - half_angle, 0.0), outer = angle + half_angle;
    float spread = kPi; // all around, when the axis lies in the cone
    if (angle > half_angle && outer < kPi)
        spread = accurate_asin(min(accurate_sin(half_angle) / accurate_sin(angle), 1.0)) + 1e-4;
    if (kModel == kOpencv) {
        inner = inner < 1.57 ? accurate_sin(inner) / accurate_cos(inner) : l.limit;
        outer = outer < 1.57 ? accurate_sin(outer) / accurate_cos(outer) : l.limit;
    }
    if (inner >= l.limit * 1.0001)
        return false;
    inner = lens_distance(kModel, l, min(inner, l.limit)).x;
    outer = min(outer, l.limit);
    // p1 and p2 move a pixel by at most this much (|2 a b| <= r^2, r^2 + 2 a^2 <= 3 r^2)
    const vec2 tangential = abs(l.first.zw);
    const vec2 moved = kModel == kOpencv ? outer * outer * (tangential + 3.0 * tangential.yx) : vec2(0.0);
    outer = lens_distance(kModel, l, outer).x;
    const float direction = accurate_atan2(s.center.y, s.center.x);
    const vec2 high = vec2(sector_end(direction, spread, inner, outer), sector_end(direction - 0.5 * kPi, spread, inner, outer));
    const vec2 low = -vec2(sector_end(direction - kPi, spread, inner, outer), sector_end(direction + 0.5 * kPi, spread, inner, outer));
    box = vec4(low - moved, high + moved) * l.focal.xyxy + l.focal.zwzw;
    return true;
}

vec4 panorama_bounds(Lens l, LensView s, float half_angle)
{
    const float ring = length(s.center.xz), up = accurate_atan2(s.center.y, ring), around = accurate_atan2(s.center.x, s.center.z);
    const float spread = abs(up) + half_angle < 1.5707 ? accurate_asin(min(accurate_sin(half_angle) * s.away / ring, 1.0)) : kPi;
    return vec4(around - spread, up - half_angle, around + spread, up + half_angle) * l.focal.xyxy + l.focal.zwzw;
}

bool find_bounds(inout LensView s, Lens l, float opacity, float sigma)
{
    const float c2 = min(p.cutoff2, 2.0 * log(opacity / p.alpha_min)), reach = 1.0001 * sqrt(c2) * sigma / s.away;
    const bool panorama = kModel == kEquirectangular;
    vec4 box = vec4(0.0, 0.0, float(p.width), float(p.height)); // the camera is within the sphere: anywhere
    bool disc = true;
    if (reach < 0.999) {
        const float half_angle = accurate_asin(reach) + 1e-6;
        if (panorama)
            box = panorama_bounds(l, s, half_angle);
        else
            disc = sector_bounds(l, s, half_angle, box);
    }
    if (s.pixel.x > kNowhere) { // the screen filter's dot
        const float dot_radius = sqrt(c2 / p.filter_scale);
        box = disc ? vec4(min(box.xy, s.pixel - dot_radius), max(box.zw, s.pixel + dot_radius))
                   : vec4(s.pixel - dot_radius, s.pixel + dot_radius);
    } else if (!disc) {
        return false;
    }
    s.bounds = ivec4(panorama ? wrapped_range(box.x, box.z) : pixel_range(box.x, box.z, p.width), pixel_range(box.y, box.w, p.height));
    return (panorama ? s.bounds.y >= 0 : s.bounds.x <= s.bounds.y) && s.bounds.z <= s.bounds.w;
}

// false: nothing of it can be seen, or it is not a splat
bool view_splat(uint splat, uint camera, out LensView s)
{
    const vec4 position = positions[splat], normal = normals[splat], color = colors[splat];
    const Lens lens = camera_lens(camera);
    if (lens.focal.x == 0.0 || !is_finite(position) || !is_finite(normal) || !is_finite(color) ||
        dot(normal.xyz, normal.xyz) < 1e-6 || !(position.w >= p.alpha_min) || !(normal.w > 0.0) || !(color.w > 0.0))
        return false;
    const mat4x3 view = camera_view(camera);
    s.center = view * vec4(position.xyz, 1.0);
    s.away = length(s.center);
    if (!((kModel == kOpencv ? s.center.z : s.away) > p.near))
        return false;
    vec3 t_u, t_v;
    tangents(normal.xyz, t_u, t_v);
    s.t_u = mat3(view) * t_u;
    s.t_v = mat3(view) * t_v;
    s.normal = mat3(view) * normal.xyz;
    if (dot(s.normal, s.center) > 0.0)
        s.normal = -s.normal;
    if (!lens_project(kModel, lens, s.center, s.pixel))
        s.pixel = vec2(kNowhere);
    return is_finite(vec4(s.pixel, s.away, 0.0)) && find_bounds(s, lens, position.w, max(normal.w, color.w));
}
