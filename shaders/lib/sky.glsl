// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// Radiance of a clear sky with some clouds: blue above, pale at the horizon, warmer and brighter around the sun.
// Needs lib/view.glsl.
float lattice(vec2 cell)
{
    uvec2 c = uvec2(ivec2(cell) + 32768);
    uint h = c.x * 0x9e3779b1u ^ c.y * 0x85ebca77u;
    h = (h ^ (h >> 15)) * 0x2c1b3c6du;
    h = (h ^ (h >> 12)) * 0x297a2d39u;
    return float((h ^ (h >> 15)) >> 8) * (1.0 / 16777216.0);
}

float smooth_noise(vec2 p)
{
    const vec2 cell = floor(p), f = p - cell, w = f * f * (3.0 - 2.0 * f);
    return mix(mix(lattice(cell), lattice(cell + vec2(1, 0)), w.x),
               mix(lattice(cell + vec2(0, 1)), lattice(cell + vec2(1, 1)), w.x), w.y);
}

float cloud_noise(vec2 p)
{
    float sum = 0.0, weight = 0.5;
    for (int octave = 0; octave < 5; ++octave) {
        sum += weight * smooth_noise(p);
        p = mat2(1.6, 1.2, -1.2, 1.6) * p + 17.0;
        weight *= 0.5;
    }
    return sum;
}

vec3 clear_sky(vec3 d)
{
    const float up = max(d.z, 0.0), toward = max(dot(d, sun_direction()), 0.0);
    const vec3 zenith = vec3(0.2, 0.34, 0.62), horizon = vec3(0.74, 0.82, 0.92);
    vec3 sky = mix(horizon, zenith, 1.0 - exp(-3.2 * up));
    const float toward2 = toward * toward, toward8 = toward2 * toward2 * toward2 * toward2;
    sky += vec3(0.42, 0.34, 0.22) * toward8 * (0.5 + 0.5 * toward8 * toward8);
    return sky * sky_level();
}

vec3 sky_light(vec3 d)
{
    vec3 sky = clear_sky(d);
    if (d.z < 0.02 || cloud_cover() <= 0.0)
        return sky;
    const vec2 at = d.xy / (d.z + 0.12) * 1.3 + cloud_seed();
    const float n = cloud_noise(at), edge = 0.72 - 0.42 * cloud_cover();
    const float amount = smoothstep(edge, edge + 0.2, n) * smoothstep(0.02, 0.22, d.z);
    const float lit = 1.0 - 0.55 * smoothstep(edge + 0.05, edge + 0.42, n);
    return mix(sky, (vec3(0.95, 0.95, 0.97) * lit + 0.12) * sky_level() * 1.15, amount * 0.9);
}
