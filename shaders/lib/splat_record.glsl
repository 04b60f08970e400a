// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// four texels of a visible splat: pixel of the centre, bounds in x, bounds in y (first | last << 16);
// m: (u, v) = m d / (1 + g . d), d from the centre in pixels; g, depth of the centre, opacity; colour, normal
const uint kRecord = 4;

// five texels of one that a camera with a lens sees: pixel of the centre, bounds; a, opacity; b, normal . centre;
// normal, depth of the centre; colour. Bounds in x whose first is beyond their last run around a panorama's seam.
const uint kRayRecord = 5;

// six where the camera moves during its readout, lengths in its still frame (moving_rays.glsl): pixel of the centre,
// bounds; u axis / sigma_u, opacity; centre from the camera at part 0, sigma_u / sigma_v; normal, depth of the centre;
// colour; drift of the centre from the camera, a part
const uint kMovingRecord = 6;

float sign_of(float v) { return v < 0.0 ? -1.0 : 1.0; }

// a unit vector in 32 bits, to about 1e-4: Cigolle et al. 2014, octahedral
float pack_normal(vec3 n)
{
    n /= abs(n.x) + abs(n.y) + abs(n.z);
    const vec2 folded = (1.0 - abs(n.yx)) * vec2(sign_of(n.x), sign_of(n.y));
    return uintBitsToFloat(packSnorm2x16(n.z < 0.0 ? folded : n.xy));
}

vec3 unpack_normal(uint bits)
{
    const vec2 e = unpackSnorm2x16(bits);
    vec3 n = vec3(e, 1.0 - abs(e.x) - abs(e.y));
    const float t = max(-n.z, 0.0);
    n.xy -= t * vec2(sign_of(n.x), sign_of(n.y));
    return normalize(n);
}

// first and last tile in x, then in y, from the second half of a record's first texel
uvec4 tile_range(uvec2 bounds, uint tile) { return uvec4(bounds.x & 0xffff, bounds.x >> 16, bounds.y & 0xffff, bounds.y >> 16) / tile; }

// first tile and number of tiles in x, then in y; in x they may run around the seam
uvec4 tile_span(uvec2 bounds, uint tile, uint tiles_x)
{
    const uvec4 range = tile_range(bounds, tile);
    const bool around = (bounds.x & 0xffff) > bounds.x >> 16;
    const uint across = around ? min(tiles_x - range.x + range.y + 1, tiles_x) : range.y - range.x + 1;
    return uvec4(range.x, across, range.z, range.w - range.z + 1);
}
