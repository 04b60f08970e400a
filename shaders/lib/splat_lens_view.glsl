// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// a splat as a camera with a lens sees it, and the pixels that it can reach (docs/method.md §5.4)
#include "lib/moving_pixel.glsl"
#include "lib/splat_tangents.glsl"

layout(constant_id = 0) const uint kModel = 1;
layout(constant_id = 2) const bool kMovers = false;
layout(constant_id = 3) const bool kMoving = false; // cameras move during their readout
layout(push_constant) uniform Push { SplatPush p; };
layout(binding = 0) readonly buffer Cameras { vec4 cameras[]; };     // [cameras, kCameraVectors]
layout(binding = 1) readonly buffer Positions { vec4 positions[]; }; // [splats] xyz, opacity
layout(binding = 2) readonly buffer Normals { vec4 normals[]; };     // [splats] xyz, sigma_u
layout(binding = 3) readonly buffer Colors { vec4 colors[]; };       // [splats] rgb, sigma_v
layout(binding = 4) readonly buffer Owners { uint owners[]; };       // [splats]
layout(binding = 5) readonly buffer Movers { vec4 movers[]; };       // [cameras, movers, 3] if kMovers: camera from mover
layout(binding = 6) readonly buffer MoverRows { uint mover_rows[]; }; // [mover_numbers] likewise

#include "lib/splat_mover.glsl"

#include "lib/splat_camera.glsl"

struct LensView {
    vec3 center;   // camera frame, metres; moving: from the camera at part 0, in its still frame, as are axes and normal
    float away;    // |center|
    vec3 t_u, t_v; // unit
    vec3 normal;   // towards the camera
    float nearness; // of the centre, by which splats are sorted
    float depth;    // of the centre
    vec2 pixel;    // of the centre; far off where the lens does not see it
    ivec4 bounds;  // first and last pixel in x, then in y; in a panorama first > last: from there on around to here
    vec3 drift;     // moving: of the centre from the camera, metres a part
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

// Pixels across a part of a sweep whose rays may lie within [low, high], which may be any number of turns away. A part is
// less than a turn. A row's rays are up to half a pixel beside the centres of its pixels.
ivec2 turning_range(Lens l, float low, float high)
{
    const float turn = 2.0 * kPi * abs(l.focal.x), margin = 0.55 + 1e-3 * (high - low), across = high - low + 2.0 * margin;
    const int end = int(p.width) - 1;
    float from = low - margin - 0.5;
    from -= turn * floor(from / turn);
    const float to = from + across;
    const bool begins = from <= float(end), ends = to >= turn; // within the part; beyond the part's other side
    if (across >= turn || (begins && ends))
        return ivec2(0, end);
    return ends ? ivec2(0, min(int(to - turn), end)) : ivec2(int(ceil(from)), begins ? min(int(to), end) : -1);
}

// rows of a sweep that look above an angle below the horizon; the angles rise
int rows_above(float angle)
{
    uint first = 0, end = p.height;
    while (first < end) {
        const uint middle = (first + end) / 2;
        if (rows[middle].x < angle)
            first = middle + 1;
        else
            end = middle;
    }
    return int(first);
}

// the largest x of radii [inner, outer] and directions within `spread` of `angle`
float sector_end(float angle, float spread, float inner, float outer)
{
    const float around = abs(angle - 2.0 * kPi * floor(angle / (2.0 * kPi) + 0.5)); // to the x axis
    const float along = accurate_cos(max(around - spread, 0.0));
    return along * (along > 0.0 ? outer : inner);
}

// the part of a sphere that holds all rays to the disc: angles from an axis, and around it from that of the centre
struct Cap {
    float inner, outer, spread;
};

// how far a disc gets while it moves in the camera's frame, from where it is in the middle
struct Sweep {
    vec3 across; // of its centre, from the first place to the last
    vec3 off;    // from the middle between those two to the place in the middle
    float rest;  // what that leaves out, and what turning adds
};

Sweep no_sweep() { return Sweep(vec3(0.0), vec3(0.0), 0.0); }

// of a disc with the half axes `reach`, in one direction
float extent(LensView s, Sweep w, vec2 reach, vec3 along)
{
    const float still = length(reach * vec2(dot(s.t_u, along), dot(s.t_v, along)));
    return kMoving ? still + 0.5 * abs(dot(w.across, along)) + abs(dot(w.off, along)) + w.rest : still;
}

// both of the sphere around the disc, seen at `half_angle`, and of the disc's extents outwards, around and along the
// axis
Cap find_cap(LensView s, Sweep w, vec3 axis, vec2 reach, float half_angle)
{
    const float along = dot(s.center, axis);
    const vec3 from_axis = s.center - along * axis;
    const float ring = length(from_axis), angle = accurate_atan2(ring, along);
    Cap cap = Cap(angle - half_angle, angle + half_angle, kPi);
    if (angle > half_angle && angle + half_angle < kPi)
        cap.spread = accurate_asin(min(accurate_sin(half_angle) / accurate_sin(angle), 1.0));
    const vec3 outwards = from_axis / max(ring, 1e-20), around = cross(axis, outwards);
    const float out_by = extent(s, w, reach, outwards);
    if (ring > 1e-5 * s.away && ring > out_by) {
        const float around_by = extent(s, w, reach, around), along_by = extent(s, w, reach, axis);
        const float close = ring - out_by, far = length(vec2(ring + out_by, around_by));
        const float low = along - along_by, high = along + along_by;
        cap.spread = min(cap.spread, accurate_atan2(around_by, close));
        cap.inner = max(cap.inner, accurate_atan2(high > 0.0 ? close : far, high));
        cap.outer = min(cap.outer, accurate_atan2(low > 0.0 ? far : close, low));
    }
    return Cap(max(cap.inner - 2e-6, 0.0), min(cap.outer + 2e-6, kPi), min(1.0001 * cap.spread + 1e-5, kPi));
}

// low x and y, high x and y of a cap around z on the image; false: wholly beyond the lens
bool sector_bounds(Lens l, LensView s, Cap cap, out vec4 box)
{
    float inner = cap.inner, outer = cap.outer;
    if (kModel == kOpencv) {
        inner = inner < 1.57 ? accurate_sin(inner) / accurate_cos(inner) : l.limit;
        outer = outer < 1.57 ? accurate_sin(outer) / accurate_cos(outer) : l.limit;
    }
    if (inner > l.limit * 1.0001)
        return false;
    inner = lens_distance(kModel, l, min(inner, l.limit)).x;
    outer = min(outer, l.limit);
    // p1 and p2 move a pixel by at most this much (|2 a b| <= r^2, r^2 + 2 a^2 <= 3 r^2), and s1 to s4
    vec2 moved = vec2(0.0);
    if (kModel == kOpencv) {
        const float s = outer * outer;
        moved = s * (abs(l.first.zw) + 3.0 * abs(l.first.wz) + abs(l.prism.xz) + s * abs(l.prism.yw));
    }
    outer = lens_distance(kModel, l, outer).x;
    const float toward = accurate_atan2(s.center.y, s.center.x), spread = cap.spread;
    const vec2 high = vec2(sector_end(toward, spread, inner, outer), sector_end(toward - 0.5 * kPi, spread, inner, outer));
    const vec2 low = -vec2(sector_end(toward - kPi, spread, inner, outer), sector_end(toward + 0.5 * kPi, spread, inner, outer));
    box = vec4(low - moved, high + moved);
    if (kModel == kFtheta) { // its linear part
        const vec2 middle = 0.5 * (low + high), half_size = 0.5 * (high - low);
        const vec2 to = vec2(l.last.y * middle.x + l.last.z * middle.y, l.last.w * middle.x + middle.y);
        const vec2 reach = vec2(abs(l.last.y) * half_size.x + abs(l.last.z) * half_size.y, abs(l.last.w) * half_size.x + half_size.y);
        box = vec4(to - reach, to + reach);
    }
    box = box * l.focal.xyxy + l.focal.zwzw;
    return true;
}

// of a cap around y
vec4 panorama_bounds(Lens l, LensView s, Cap cap)
{
    const float to = accurate_atan2(s.center.x, s.center.z);
    return vec4(to - cap.spread, 0.5 * kPi - cap.outer, to + cap.spread, 0.5 * kPi - cap.inner) * l.focal.xyxy + l.focal.zwzw;
}

// low x and y, high x and y of what the disc covers on the image; false: wholly beyond the lens
bool disc_bounds(Lens l, LensView s, Sweep w, vec2 reach, out vec4 box)
{
    const float widest = max(reach.x, reach.y) + (kMoving ? 0.5 * length(w.across) + length(w.off) + w.rest : 0.0);
    const float sphere = widest / s.away; // 1 and more: the camera is within
    const bool panorama = kModel == kEquirectangular || kModel == kSpinning;
    vec3 axis = vec3(0.0, 0.0, 1.0); // note: Mesa 22 gets a choice of vectors wrong where the condition is a constant
    if (panorama)
        axis = vec3(0.0, 1.0, 0.0);
    const Cap cap = find_cap(s, w, axis, reach, sphere < 0.999 ? accurate_asin(sphere) : kPi);
    box = vec4(0.0);
    if (!panorama)
        return sector_bounds(l, s, cap, box);
    box = panorama_bounds(l, s, cap);
    return true;
}

// the pixels of a box; false: there are none
bool pixels_within(Lens l, inout LensView s, vec4 box)
{
    if (kModel == kSpinning) { // columns may run against the azimuth
        const ivec2 across = turning_range(l, min(box.x, box.z), max(box.x, box.z));
        s.bounds = ivec4(across, rows_above(box.y - 1e-6), rows_above(box.w + 1e-6) - 1);
        return s.bounds.x <= s.bounds.y && s.bounds.z <= s.bounds.w;
    }
    const bool panorama = kModel == kEquirectangular;
    s.bounds = ivec4(panorama ? wrapped_range(box.x, box.z) : pixel_range(box.x, box.z, p.width), pixel_range(box.y, box.w, p.height));
    return (panorama ? s.bounds.y >= 0 : s.bounds.x <= s.bounds.y) && s.bounds.z <= s.bounds.w;
}

// how far a splat is seen, in sigmas
float sigmas_seen(float opacity) { return sqrt(min(p.cutoff2, 2.0 * log(opacity / p.alpha_min))); }

bool find_bounds(inout LensView s, Lens l, float opacity, vec2 sigmas)
{
    const float c = sigmas_seen(opacity);
    vec4 box;
    const bool disc = disc_bounds(l, s, no_sweep(), 1.0001 * c * sigmas, box);
    if (s.pixel.x > kNowhere) { // the screen filter's dot
        const float dot_radius = c / sqrt(p.filter_scale);
        box = disc ? vec4(min(box.xy, s.pixel - dot_radius), max(box.zw, s.pixel + dot_radius))
                   : vec4(s.pixel - dot_radius, s.pixel + dot_radius);
    } else if (!disc) {
        return false;
    }
    return pixels_within(l, s, box);
}

#include "lib/splat_readout.glsl"

// false: nothing of it can be seen, or it is not a splat
bool view_splat(uint splat, uint camera, out LensView s)
{
    const vec4 position = positions[splat], normal = normals[splat], color = colors[splat];
    const Lens lens = camera_lens(camera);
    if (lens.focal.x == 0.0 || !is_finite(position) || !is_finite(normal) || !is_finite(color) ||
        dot(normal.xyz, normal.xyz) < 1e-6 || !(position.w >= p.alpha_min) || !(normal.w > 0.0) || !(color.w > 0.0))
        return false;
    mat4x3 view = camera_view(camera);
    Course course = standing();
    const uint row = kMovers ? mover_of(owners[splat], p.mover_numbers) : 0;
    if (row != 0) {
        const uint at = (camera * p.movers + row - 1) * (kMoving ? 6 : 3);
        view = transpose(mat3x4(movers[at], movers[at + 1], movers[at + 2]));
        if (kMoving) {
            const vec4 turn = movers[at + 3], shift = movers[at + 4], pivot = movers[at + 5];
            course = Course(pivot.xyz, turn.xyz, shift.xyz);
        }
    }
    s.center = view * vec4(position.xyz, 1.0);
    vec3 t_u, t_v;
    tangents(normal.xyz, t_u, t_v);
    s.t_u = mat3(view) * t_u;
    s.t_v = mat3(view) * t_v;
    s.normal = mat3(view) * normal.xyz;
    s.drift = vec3(0.0);
    const vec2 sigmas = vec2(normal.w, color.w);
    if (kMoving) // a mover that is not there has a view of zeros
        return dot(s.normal, s.normal) > 0.0 && view_moving(lens, camera, course, position.w, sigmas, s);
    s.away = length(s.center);
    s.nearness = kModel == kOpencv ? s.center.z : s.away;
    s.depth = camera_depth_is_radial(camera) ? s.away : s.center.z;
    if (!(s.nearness > p.near))
        return false;
    if (dot(s.normal, s.center) > 0.0)
        s.normal = -s.normal;
    if (kModel == kSpinning || !lens_project(kModel, lens, s.center, s.pixel)) // no screen filter
        s.pixel = vec2(kNowhere);
    return is_finite(vec4(s.pixel, s.away, 0.0)) && find_bounds(s, lens, position.w, sigmas);
}
