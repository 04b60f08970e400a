// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// A camera that moves while its picture is read out line by line, so that each pixel's ray has an origin of its own
// (docs/method.md §5.4). `part` says when: -1/2 at the start of the readout, 1/2 at its end. The camera's own frame at
// part 0, in the middle, is called the still frame. Whatever the lens. Needs trigonometry.glsl.
struct Motion {
    vec3 turn;   // from start to end, axis times radians, of the still frame
    vec3 shift;  // from start to end, metres, of the still frame
    vec2 across; // part of a position in the picture: dot(across, position) + first
    float first;
};

float part_of(Motion m, vec2 position) { return dot(m.across, position) + m.first; }

// p turned around an axis by part of an angle (Rodrigues), without loss where the angle is small
vec3 turned(vec3 turn, float part, vec3 p)
{
    const float whole = length(turn);
    if (!(whole > 0.0))
        return p;
    const vec3 axis = turn / whole, across = cross(axis, p);
    const float angle = whole * part, half_sine = accurate_sin(0.5 * angle);
    return p + accurate_sin(angle) * across + 2.0 * half_sine * half_sine * cross(axis, across);
}

// a point of the still frame as the camera has it in its own frame at a part
vec3 seen_at(Motion m, float part, vec3 point) { return turned(m.turn, -part, point - part * m.shift); }
