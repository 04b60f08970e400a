// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// a splat as a camera sees it that moves during its readout (docs/method.md §5.4): the pixels that it can reach, and
// when the line that shows its centre is read. Needs splat_lens_view.glsl.

// the disc as the camera has it in the middle of the parts [low, high], and how far it gets in them
Sweep sweep_of(LensView still, Motion m, Course c, float low, float high, float reach, out LensView s)
{
    const float middle = 0.5 * (low + high), time = high - low;
    s = still;
    s.center = seen_at(m, c, middle, still.center);
    s.t_u = turned(m.turn, -middle, turned(c.turn, middle, still.t_u));
    s.t_v = turned(m.turn, -middle, turned(c.turn, middle, still.t_v));
    s.away = length(s.center);
    const vec3 first = seen_at(m, c, low, still.center), last = seen_at(m, c, high, still.center);
    // what is quadratic in time lies within `across` and `off`. The third derivative is at most
    // turn^3 distance + 3 turn^2 shift, of which a quadratic through three points leaves 1 / 124.7.
    const float turn = (length(m.turn) + length(c.turn)) * time, shift = (length(m.shift) + length(c.shift)) * time;
    const float arms = s.away + 2.0 * length(still.center - c.pivot);
    const float rest = turn * turn * (turn * (arms + shift) + 3.0 * shift) / 124.0 + 0.5 * turn * reach + 1e-6 * arms;
    return Sweep(last - first, s.center - 0.5 * (first + last), rest);
}

// The parts within [low, high] at which lines are read that a box touches. Around a panorama's seam: all of them.
// bounds: of a sweep, the pixels in the box
vec2 parts_of(Lens l, Motion m, vec4 box, ivec4 bounds, float low, float high)
{
    if (kModel == kSpinning) {
        const vec2 columns = l.first.x + vec2(bounds.xy) + l.first.zw;
        return clamp(columns / l.first.y - 0.5 + vec2(-1e-5, 1e-5), vec2(low), vec2(high));
    }
    if (kModel == kEquirectangular && m.across.x != 0.0 && (box.x < 1.0 || box.z > float(p.width) - 1.0))
        return vec2(low, high);
    const vec2 margin = 0.5 + 1e-3 * (box.zw - box.xy);
    const float a = part_of(m, box.xy - margin), b = part_of(m, box.zw + margin);
    return clamp(vec2(min(a, b), max(a, b)), vec2(low), vec2(high));
}

// of a sweep: the part at which a column looks at a point, with the middle of what rows add to it. Beside a part of the
// sweep it is the turn that is nearer to it.
float part_of_column(Lens l, Motion m, Course c, vec3 point)
{
    const float turn = 2.0 * kPi * abs(l.focal.x), added = l.first.x + 0.5 * (l.first.z + l.first.w);
    float part = 0.0;
    for (uint i = 0; i < 4; ++i) {
        const vec3 seen = seen_at(m, c, part, point);
        float x = l.focal.x * accurate_atan2(seen.x, seen.z) + l.focal.z - 0.5;
        x -= turn * floor((x - 0.5 * float(p.width)) / turn + 0.5);
        part = clamp((x + added) / l.first.y - 0.5, -0.5, 0.5);
    }
    return part;
}

// finds s.pixel; the part of the line that shows the centre, the middle one where none does
float part_of_center(Lens l, Motion m, Course c, float low, float high, inout LensView s)
{
    const float guesses[3] = {0.5 * (low + high), low, high};
    if (kModel == kSpinning) { // no screen filter
        s.pixel = vec2(kNowhere);
        return part_of_column(l, m, c, s.center);
    }
    for (uint i = 0; i < 3; ++i) {
        float part = guesses[i];
        if (settle(kModel, l, m, c, s.center, low, high, part, s.pixel))
            return part;
    }
    s.pixel = vec2(kNowhere);
    return 0.0;
}

float nearness_of(vec3 seen) { return kModel == kOpencv ? seen.z : length(seen); }

// what a disc covers that is near enough in the parts [low, high], middle: as sweep_of has it
bool readout_bounds(Lens l, Motion m, Course c, LensView still, float low, float high, vec2 reach,
                    out LensView middle, out vec4 box)
{
    const Sweep w = sweep_of(still, m, c, low, high, max(reach.x, reach.y), middle);
    const float moves = 0.5 * length(w.across) + length(w.off) + w.rest;
    box = vec4(0.0);
    return is_finite(vec4(middle.away)) && nearness_of(middle.center) + moves > p.near &&
           disc_bounds(l, middle, w, reach, box);
}

const uint kSlices = 8;

// what of a box in a flat picture is on the lines that are read in [parts.x, parts.y]
vec4 on_lines(Motion m, vec4 box, vec2 parts)
{
    const bool down = m.across.y != 0.0; // else lines are columns
    const vec2 ends = (parts - m.first) / (down ? m.across.y : m.across.x);
    const vec2 lines = vec2(min(ends.x, ends.y) - 0.05, max(ends.x, ends.y) + 0.05);
    return down ? vec4(box.x, max(box.y, lines.x), box.z, min(box.w, lines.y))
                : vec4(max(box.x, lines.x), box.y, min(box.z, lines.y), box.w);
}

// s: center, axes and normal at part 0, in the still frame. Bounds are found for the whole readout first, then for the
// parts of the lines that are within them. Where those are still many of a flat picture, as of a disc that passes close
// by, they are those of slices: of each what its own lines show. Whether the centre is too near is asked for each
// pixel.
bool view_moving(Lens l, uint camera, Course course, float opacity, vec2 sigmas, inout LensView s)
{
    const Motion m = camera_motion(camera);
    const float c = sigmas_seen(opacity), dot_radius = c / sqrt(p.filter_scale);
    const vec2 reach = 1.0001 * c * sigmas;
    float low = -0.5, high = 0.5;
    vec4 box, sliced = vec4(1e9, 1e9, -1e9, -1e9);
    bool slices = false;
    // note: one loop for both, as compilers take long for its body
    for (uint round = 0; round < (slices ? kSlices : 3u); ++round) {
        vec2 parts = vec2(low, high);
        if (slices)
            parts = mix(vec2(low), vec2(high), vec2(round, round + 1) / float(kSlices));
        LensView middle;
        const bool seen = readout_bounds(l, m, course, s, parts.x, parts.y, reach, middle, box);
        if (slices) {
            box = on_lines(m, box, parts);
            if (seen && box.x <= box.z && box.y <= box.w)
                sliced = vec4(min(sliced.xy, box.xy), max(sliced.zw, box.zw));
            continue;
        }
        if (!seen || !pixels_within(l, s, vec4(box.xy - dot_radius, box.zw + dot_radius)))
            return false;
        const vec2 left = parts_of(l, m, box, s.bounds, low, high);
        const bool narrower = left.y - left.x <= 0.7 * (high - low);
        if (narrower) {
            low = left.x;
            high = left.y;
        }
        if (narrower && round < 2)
            continue;
        slices = kModel != kEquirectangular && kModel != kSpinning && high - low > 1.0 / float(kSlices);
        if (!slices)
            break;
        round = ~0u;
    }
    if (slices)
        box = sliced;
    const float part = part_of_center(l, m, course, low, high, s);
    const vec3 seen = seen_at(m, course, part, s.center);
    s.away = length(seen);
    s.nearness = max(nearness_of(seen), 0.0);
    s.depth = camera_depth_is_radial(camera) ? s.away : seen.z;
    // a thing that moves is taken to go straight on while its lines are read, from where it is in that of its centre
    const vec3 arm = turned(course.turn, part, s.center - course.pivot);
    s.drift = course.shift + cross(course.turn, arm) - m.shift;
    s.center = place_at(course, part, s.center) - part * (m.shift + s.drift);
    s.t_u = turned(course.turn, part, s.t_u);
    s.normal = turned(course.turn, part, s.normal);
    vec2 pixel = s.pixel;
    if (kModel == kEquirectangular) // on the side of the seam that the box is on
        pixel.x -= float(p.width) * floor((pixel.x - 0.5 * (box.x + box.z)) / float(p.width) + 0.5);
    if (s.pixel.x > kNowhere)
        box = vec4(min(box.xy, pixel - dot_radius), max(box.zw, pixel + dot_radius));
    return is_finite(vec4(s.pixel, s.away, 0.0)) && pixels_within(l, s, box);
}
