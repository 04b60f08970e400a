#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// A token's points as grids store them: fp16 metres from the voxel's centre and 8-bit colours, by increasing distance
// to the centre, ties by x, y, z, then in the token's order. One point a thread, which counts those before it.
// Distances are compared as exact integers, in units of the smallest fp16 number: no two devices order points in other
// ways.
#extension GL_GOOGLE_include_directive : require
#include "lib/half.glsl"
#include "lib/rounding.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform DecodeTokensPush {
    uint rows;
    uint ld;     // elements, of tokens
    uint points; // of a token
    float half_voxel;
} p;
layout(binding = 0) readonly buffer Tokens { float tokens[]; };               // [rows, 6 points]
layout(binding = 1) readonly buffer Normalization { float normalization[]; }; // [2, 6] mean, std
layout(binding = 2) writeonly buffer Y { uint y[]; };                         // [rows, 3 points]

struct Point {
    uint xy, z;         // fp16
    ivec3 place;        // the same as whole numbers
    uint far_hi, far_lo; // squared distance, 64 bits
};

float denormalized(uint at, uint channel)
{
    precise float scaled = tokens[at + channel] * normalization[6 + channel];
    precise float v = scaled + normalization[channel];
    return clamp(v, -1.0, 1.0);
}

float metres(uint at, uint axis)
{
    precise float v = denormalized(at, axis) * p.half_voxel;
    return v;
}

int whole(uint bits)
{
    const uint exponent = (bits >> 10) & 31u, mantissa = bits & 1023u;
    const int size = int(exponent == 0 ? mantissa : (1024u + mantissa) << (exponent - 1));
    return (bits & 0x8000u) != 0 ? -size : size;
}

Point point_of(uint row, uint i)
{
    const uint at = row * p.ld + 6 * i;
    Point made;
    made.xy = pack_halves(vec2(metres(at, 0), metres(at, 1)));
    made.z = pack_halves(vec2(metres(at, 2), 0.0));
    made.place = ivec3(whole(made.xy & 0xffffu), whole(made.xy >> 16), whole(made.z));
    made.far_hi = 0;
    made.far_lo = 0;
    for (uint a = 0; a < 3; ++a) {
        const uint size = uint(abs(made.place[a]));
        uint hi, lo, carry;
        umulExtended(size, size, hi, lo);
        made.far_lo = uaddCarry(made.far_lo, lo, carry);
        made.far_hi += hi + carry;
    }
    return made;
}

bool is_before(Point a, uint i, Point b, uint k)
{
    if (a.far_hi != b.far_hi)
        return a.far_hi < b.far_hi;
    if (a.far_lo != b.far_lo)
        return a.far_lo < b.far_lo;
    for (uint axis = 0; axis < 3; ++axis)
        if (a.place[axis] != b.place[axis])
            return a.place[axis] < b.place[axis];
    return i < k;
}

bool is_finite(uint at)
{
    for (uint c = 0; c < 6; ++c)
        if ((floatBitsToUint(tokens[at + c]) & 0x7f800000u) == 0x7f800000u)
            return false;
    return true;
}

uint byte_of(uint at, uint channel)
{
    precise float shifted = denormalized(at, channel) + 1.0;
    precise float v = shifted * 127.5;
    return rounded(v);
}

void main()
{
    const uint row = linear_thread() / p.points, i = linear_thread() % p.points;
    if (row >= p.rows)
        return;
    const Point own = point_of(row, i);
    uint place = 0;
    for (uint k = 0; k < p.points; ++k)
        if (k != i && is_before(point_of(row, k), k, own, i))
            ++place;
    const uint at = row * p.ld + 6 * i, to = 3 * (row * p.points + place);
    y[to] = own.xy;
    y[to + 1] = own.z | (is_finite(at) ? 0u : 0x80000000u);
    y[to + 2] = byte_of(at, 3) | byte_of(at, 4) << 8 | byte_of(at, 5) << 16;
}
