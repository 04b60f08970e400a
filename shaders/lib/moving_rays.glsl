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
    const bool turns = whole > 0.0;
    const vec3 axis = turn / (turns ? whole : 1.0), across = cross(axis, p);
    const float angle = whole * part, half_sine = accurate_sin(0.5 * angle);
    return p + accurate_sin(angle) * across + 2.0 * half_sine * half_sine * cross(axis, across);
}

// how a thing itself moves meanwhile, in the still frame: turn and shift as of the camera, about a pivot at part 0
struct Course {
    vec3 pivot, turn, shift;
};

Course standing() { return Course(vec3(0.0), vec3(0.0), vec3(0.0)); }

// where a point of it is at a part, of its place at part 0
vec3 place_at(Course c, float part, vec3 point) { return c.pivot + part * c.shift + turned(c.turn, part, point - c.pivot); }

// such a point as the camera has it in its own frame at a part
vec3 seen_at(Motion m, Course c, float part, vec3 point)
{
    return turned(m.turn, -part, place_at(c, part, point) - part * m.shift);
}
