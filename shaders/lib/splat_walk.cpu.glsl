// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// how a block of 8 x 8 pixels walks the list of its tile on a CPU: the lanes of a subgroup look at as many records at
// once, in a loop of its own, because there a branch that nobody takes still costs; no more than 8 lanes run.
// Needs Records, kTexels (texels of a record), overlaps(bounds, corner) and the lane's pixels[kRows].
struct Walk {
    uint first, end; // of the list, what is left
    uint candidate;  // record of this lane
    uint hits;       // lanes whose records touch the block
};

Walk walk_of(uint tile) { return Walk(starts[tile], starts[tile + 1], 0, 0); }

// goes on to the next lanes with hits; false: there are none
bool find_hits(inout Walk w, uvec2 corner)
{
    if (w.first >= w.end)
        return false;
    do {
        const uint at = w.first + gl_SubgroupInvocationID;
        w.candidate = pairs[min(at, w.end - 1)];
        const uvec2 bounds = texelFetch(Records, int(w.candidate * kTexels)).zw;
        w.hits = subgroupBallot(at < w.end && overlaps(bounds, corner)).x;
        w.first += min(gl_SubgroupSize, 8);
    } while (w.hits == 0 && w.first < w.end);
    return w.hits != 0;
}

// the nearest of the hits, which is then no longer one
uint take_hit(inout Walk w)
{
    const uint record = subgroupShuffle(w.candidate, findLSB(w.hits));
    w.hits &= w.hits - 1;
    return record;
}

vec4 texel_of(uint record, uint i) { return uintBitsToFloat(texelFetch(Records, int(record * kTexels + i))); }

// is a pixel of the subgroup not done?
bool any_left()
{
    float left = -1.0;
    [[unroll]] for (uint y = 0; y < kRows; ++y)
        left = max(left, pixels[y].transmittance);
    return subgroupAny(left > 0.0);
}
