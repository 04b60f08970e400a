// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// rays in a camera's frame (x right, y down, z forward) to pixels and back: formulas and limits as in
// engine/camera/lens.h. The model is an argument so that a constant of the shader can choose it.
#include "lib/trigonometry.glsl"

const uint kOpencv = 1, kFisheye = 2, kEquirectangular = 3, kFtheta = 4; // CameraModel; 0: pinhole
const uint kSpinning = 5;                                                // a sweep of a lidar, whose rows have a table

const float kPi = 3.14159265359;

struct Lens {
    vec4 focal; // fx fy cx cy
    vec4 first; // opencv: k1 k2 p1 p2; fisheye: k1 k2 k3 k4; ftheta: p1 p2 p3 p4
    vec4 last;  // opencv: k3 k4 k5 k6; ftheta: p5, c d e
    vec4 prism; // opencv: s1 s2 s3 s4; ftheta: max_angle, 1 where the polynomial is from pixels to angles
    float limit; // opencv: distance from the axis at z = 1; fisheye, ftheta: angle from the axis
    float reach; // ftheta: distance from the centre on the image
};

// R of s = r^2, and its derivative
vec2 opencv_factor(Lens l, float s)
{
    const float top = 1.0 + s * (l.first.x + s * (l.first.y + s * l.last.x));
    const float bottom = 1.0 + s * (l.last.y + s * (l.last.z + s * l.last.w));
    const float top_slope = l.first.x + s * (2.0 * l.first.y + s * 3.0 * l.last.x);
    const float bottom_slope = l.last.y + s * (2.0 * l.last.z + s * 3.0 * l.last.w);
    return vec2(top / bottom, (top_slope * bottom - top * bottom_slope) / (bottom * bottom));
}

// the reference polynomial of an f-theta lens, and its derivative
vec2 ftheta_polynomial(Lens l, float x)
{
    const vec4 k = l.first;
    return vec2(x * (k.x + x * (k.y + x * (k.z + x * (k.w + x * l.last.x)))),
                k.x + x * (2.0 * k.y + x * (3.0 * k.z + x * (4.0 * k.w + x * 5.0 * l.last.x))));
}

// x of y of that, at most `end`: Newton's method, halving where it would leave the bracket
float ftheta_inverse(Lens l, float y, float end)
{
    float low = 0.0, high = end, x = min(y / l.first.x, end);
    for (uint i = 0; i < 40; ++i) {
        const vec2 at = ftheta_polynomial(l, x);
        if (at.x < y)
            low = x;
        else
            high = x;
        float next = x - (at.x - y) / at.y;
        if (!(next >= low && next <= high))
            next = 0.5 * (low + high);
        const float step = abs(next - x);
        x = next;
        if (step <= 1e-7 * x)
            break;
    }
    return x;
}

bool ftheta_is_backward(Lens l) { return l.prism.y != 0.0; }

float ftheta_distance(Lens l, float angle)
{
    return ftheta_is_backward(l) ? ftheta_inverse(l, angle, l.reach) : ftheta_polynomial(l, angle).x;
}
float ftheta_angle(Lens l, float distance)
{
    return ftheta_is_backward(l) ? ftheta_polynomial(l, distance).x : ftheta_inverse(l, distance, l.limit);
}

// opencv: distance from the axis on the image, without what is not radial, of distance r at z = 1; fisheye: of angle r;
// and the derivative. Both rise up to the limit. ftheta: of angle r, without the derivative
vec2 lens_distance(uint model, Lens l, float r)
{
    if (model == kFtheta)
        return vec2(ftheta_distance(l, r), 0.0);
    const float s = r * r;
    if (model == kFisheye)
        return vec2(r * (1.0 + s * (l.first.x + s * (l.first.y + s * (l.first.z + s * l.first.w)))),
                    1.0 + s * (3.0 * l.first.x + s * (5.0 * l.first.y + s * (7.0 * l.first.z + s * 9.0 * l.first.w))));
    const vec2 factor = opencv_factor(l, s);
    return vec2(r * factor.x, factor.x + 2.0 * s * factor.y);
}

// r of a distance on the image, at most the limit: Newton's method, halving where it would leave the bracket
float lens_undistance(uint model, Lens l, float distance)
{
    if (model == kFtheta)
        return ftheta_angle(l, distance);
    float low = 0.0, high = l.limit, r = min(distance, high);
    for (uint i = 0; i < 40; ++i) {
        const vec2 at = lens_distance(model, l, r);
        if (at.x < distance)
            low = r;
        else
            high = r;
        float next = r - (at.x - distance) / at.y;
        if (!(next >= low && next <= high))
            next = 0.5 * (low + high);
        const float step = abs(next - r);
        r = next;
        if (step <= 1e-7 * r)
            break;
    }
    return r;
}

vec2 opencv_bend(Lens l, vec2 a)
{
    const float s = dot(a, a), factor = opencv_factor(l, s).x;
    return a * factor + 2.0 * a.x * a.y * l.first.zw + l.first.wz * (s + 2.0 * a * a) + s * (l.prism.xz + s * l.prism.yw);
}

// nothing but what depends on the distance from the axis
bool opencv_is_radial(Lens l) { return all(equal(l.first.zw, vec2(0.0))) && all(equal(l.prism, vec4(0.0))); }

// columns: derivatives by a.x and a.y
mat2 opencv_slopes(Lens l, vec2 a)
{
    const float s = dot(a, a);
    const vec2 factor = opencv_factor(l, s), prism = 2.0 * (l.prism.xz + 2.0 * s * l.prism.yw);
    const float p1 = l.first.z, p2 = l.first.w, across = 2.0 * (a.x * a.y * factor.y + p1 * a.x + p2 * a.y);
    return mat2(factor.x + 2.0 * a.x * a.x * factor.y + 2.0 * p1 * a.y + 6.0 * p2 * a.x + prism.x * a.x, across + prism.y * a.x,
                across + prism.x * a.y, factor.x + 2.0 * a.y * a.y * factor.y + 6.0 * p1 * a.y + 2.0 * p2 * a.x + prism.y * a.y);
}

// (x, y) at z = 1 of a position on the image in focal lengths; false where the lens does not look
bool opencv_unbend(Lens l, vec2 bent, out vec2 a)
{
    const float distance = length(bent);
    a = distance > 0.0 ? bent * (lens_undistance(kOpencv, l, distance) / distance) : vec2(0.0);
    if (!opencv_is_radial(l))
        for (uint i = 0; i < 6; ++i) {
            const mat2 slopes = opencv_slopes(l, a);
            const vec2 off = bent - opencv_bend(l, a);
            const float det = slopes[0].x * slopes[1].y - slopes[0].y * slopes[1].x;
            if (abs(det) < 1e-12)
                break;
            a += vec2(slopes[1].y * off.x - slopes[1].x * off.y, slopes[0].x * off.y - slopes[0].y * off.x) / det;
            a *= min(1.0, l.limit / max(length(a), 1e-20)); // back to where the formula holds
        }
    const vec2 off = opencv_bend(l, a) - bent;
    return dot(off, off) <= 1e-10 * (1.0 + distance * distance);
}

bool lens_project(uint model, Lens l, vec3 p, out vec2 pixel)
{
    const float across = length(p.xy);
    vec2 a = vec2(0.0);
    bool seen = true;
    if (model == kEquirectangular) {
        a = vec2(accurate_atan2(p.x, p.z), accurate_atan2(p.y, length(p.xz)));
    } else if (model == kFisheye || model == kFtheta) {
        const float angle = accurate_atan2(across, p.z);
        seen = angle <= l.limit && (across > 0.0 || p.z > 0.0);
        a = across > 0.0 ? p.xy * (lens_distance(model, l, angle).x / across) : vec2(0.0);
        if (model == kFtheta)
            a = vec2(l.last.y * a.x + l.last.z * a.y, l.last.w * a.x + a.y);
    } else {
        a = p.xy / p.z;
        seen = p.z > 0.0;
        if (model == kOpencv) {
            seen = seen && length(a) <= l.limit;
            a = opencv_bend(l, a);
        }
    }
    pixel = l.focal.xy * a + l.focal.zw;
    return seen;
}

// unit ray through a position in the image
bool lens_unproject(uint model, Lens l, vec2 pixel, out vec3 ray)
{
    vec2 a = (pixel - l.focal.zw) / l.focal.xy;
    bool seen = true;
    if (model == kEquirectangular) {
        const float ring = accurate_cos(a.y);
        ray = vec3(accurate_sin(a.x) * ring, accurate_sin(a.y), accurate_cos(a.x) * ring);
        return true;
    }
    if (model == kFtheta)
        a = vec2(a.x - l.last.z * a.y, l.last.y * a.y - l.last.w * a.x) / (l.last.y - l.last.z * l.last.w);
    if (model == kFisheye || model == kFtheta) {
        const float distance = length(a), angle = lens_undistance(model, l, distance);
        ray = vec3(distance > 0.0 ? a * (accurate_sin(angle) / distance) : vec2(0.0), accurate_cos(angle));
        return distance <= lens_distance(model, l, l.limit).x;
    }
    if (model == kOpencv) {
        const vec2 bent = a;
        seen = opencv_unbend(l, bent, a);
    }
    ray = normalize(vec3(a, 1.0));
    return seen;
}
