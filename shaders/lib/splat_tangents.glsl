// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

bool is_finite(vec4 v)
{
    const uvec4 exponent = floatBitsToUint(v) & 0x7f800000u;
    return all(notEqual(exponent, uvec4(0x7f800000u)));
}

// t_u = normalize(e x n), e the axis least aligned with n; t_v = n x t_u
void tangents(vec3 n, out vec3 t_u, out vec3 t_v)
{
    const vec3 s = abs(n);
    const vec3 e = s.x <= s.y && s.x <= s.z ? vec3(1, 0, 0) : s.y <= s.z ? vec3(0, 1, 0) : vec3(0, 0, 1);
    t_u = normalize(cross(e, n));
    t_v = cross(n, t_u);
}

// pixels whose centres lie within [low, high], widened by what fp32 may be wrong
ivec2 pixel_range(float low, float high, uint size)
{
    const float margin = 0.05 + 1e-3 * (high - low);
    const float first = ceil(max(low - margin - 0.5, 0.0)), last = floor(min(high + margin - 0.5, float(size) - 1.0));
    return ivec2(clamp(first, 0.0, float(size)), clamp(last, -1.0, float(size)));
}
