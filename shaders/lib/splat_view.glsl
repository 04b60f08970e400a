// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// a splat as a camera sees it, and the pixels that it can reach (docs/method.md §5.3)
#include "lib/splat_tangents.glsl"

layout(constant_id = 2) const bool kMovers = false;
layout(push_constant) uniform Push { SplatPush p; };
layout(binding = 0) readonly buffer Cameras { vec4 cameras[]; };     // [cameras, 4] fx fy cx cy; world to camera
layout(binding = 1) readonly buffer Positions { vec4 positions[]; }; // [splats] xyz, opacity
layout(binding = 2) readonly buffer Normals { vec4 normals[]; };     // [splats] xyz, sigma_u
layout(binding = 3) readonly buffer Colors { vec4 colors[]; };       // [splats] rgb, sigma_v
layout(binding = 4) readonly buffer Owners { uint owners[]; };       // [splats]
layout(binding = 5) readonly buffer Movers { vec4 movers[]; };       // [cameras, movers, 3] if kMovers: camera from mover
layout(binding = 6) readonly buffer MoverRows { uint mover_rows[]; }; // [mover_numbers] likewise

#include "lib/splat_mover.glsl"

struct SplatView {
    vec3 center; // camera frame, metres
    vec3 u, v;   // axes times their sigmas
    vec3 normal; // towards the camera
    vec2 pixel;  // of the centre
    vec2 a, b;   // derivatives of pixel x and y by (u, v) at the centre
    ivec4 bounds; // first and last pixel in x, then in y
};

// where opacity exp(-r^2 / 2) >= alpha_min, r in sigmas: the union of the surface's ellipse and the screen filter's disc
bool find_bounds(inout SplatView s, float opacity)
{
    const float c2 = min(p.cutoff2, 2.0 * log(opacity / p.alpha_min));
    const float d = c2 * (s.u.z * s.u.z + s.v.z * s.v.z) - s.center.z * s.center.z;
    if (d >= -1e-6 * s.center.z * s.center.z) { // reaches the plane of the camera: anywhere
        s.bounds = ivec4(0, int(p.width) - 1, 0, int(p.height) - 1);
        return true;
    }
    const vec2 shift = c2 * vec2(dot(s.a, vec2(s.u.z, s.v.z)), dot(s.b, vec2(s.u.z, s.v.z))) / d * s.center.z;
    const vec2 extent = sqrt(max(shift * shift - c2 * s.center.z * s.center.z * vec2(dot(s.a, s.a), dot(s.b, s.b)) / d, 0.0));
    const float dot_radius = sqrt(c2 / p.filter_scale);
    const vec2 low = s.pixel + min(shift - extent, -dot_radius), high = s.pixel + max(shift + extent, dot_radius);
    s.bounds = ivec4(pixel_range(low.x, high.x, p.width), pixel_range(low.y, high.y, p.height));
    return s.bounds.x <= s.bounds.y && s.bounds.z <= s.bounds.w;
}

// false: nothing of it can be seen, or it is not a splat (not finite, without normal, size or opacity)
bool view_splat(uint splat, uint camera, out SplatView s)
{
    const vec4 position = positions[splat], normal = normals[splat], color = colors[splat];
    const vec4 lens = cameras[camera * 4];
    if (lens.x == 0.0 || !is_finite(position) || !is_finite(normal) || !is_finite(color) || dot(normal.xyz, normal.xyz) < 1e-6 ||
        !(position.w >= p.alpha_min) || !(normal.w > 0.0) || !(color.w > 0.0))
        return false;
    vec4 x = cameras[camera * 4 + 1], y = cameras[camera * 4 + 2], z = cameras[camera * 4 + 3];
    const uint row = kMovers ? mover_of(owners[splat], p.mover_numbers) : 0;
    if (row != 0) {
        const uint at = (camera * p.movers + row - 1) * 3;
        x = movers[at];
        y = movers[at + 1];
        z = movers[at + 2];
    }
    const mat3 turn = transpose(mat3(x.xyz, y.xyz, z.xyz));
    s.center = turn * position.xyz + vec3(x.w, y.w, z.w);
    if (!(s.center.z > p.near))
        return false;
    vec3 t_u, t_v;
    tangents(normal.xyz, t_u, t_v);
    s.u = turn * t_u * normal.w;
    s.v = turn * t_v * color.w;
    s.normal = turn * normal.xyz;
    if (dot(s.normal, s.center) > 0.0)
        s.normal = -s.normal;
    const vec2 n = s.center.xy / s.center.z;
    s.pixel = lens.xy * n + lens.zw;
    s.a = lens.x * vec2(s.u.x - n.x * s.u.z, s.v.x - n.x * s.v.z) / s.center.z;
    s.b = lens.y * vec2(s.u.y - n.y * s.u.z, s.v.y - n.y * s.v.z) / s.center.z;
    return is_finite(vec4(s.pixel, s.a)) && find_bounds(s, position.w);
}
