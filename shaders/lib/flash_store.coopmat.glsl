// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// The end of flash_attention.coopmat.comp: sums of a subgroup's rows, divided by their totals, to y.

// sums from column kMatN piece on, to this subgroup's part of shared memory. note: compilers must know which sums are
// stored, or all of them lie in memory
void put_sums(uint piece)
{
    own_barrier();
    [[unroll]] for (uint i = 0; i < kDown * kAcross; ++i)
        if (i % kAcross == piece)
            coopMatStore(sums[i], weights, own_at + i / kAcross * kMatM * kWeightPitch, kWeightPitch,
                         gl_CooperativeMatrixLayoutRowMajor);
    own_barrier();
}

// y_at: of the image's first row in y
void store(uint first_query, uint y_at)
{
    float inverse[kOwnRows];
    put_sums(kTotalAt);
    [[unroll]] for (uint r = 0; r < kOwnRows; ++r)
        inverse[r] = 1.0 / uintBitsToFloat(weights[own_at + min(own_row(r), kQueries - 1) * kWeightPitch +
                                                   kChunks * 8 % kMatN / 4].x);
    [[dont_unroll]] for (uint piece = 0; piece < (kChunks * 8 + kMatN - 1) / kMatN; ++piece) {
        put_sums(piece);
        [[unroll]] for (uint r = 0; r < kOwnRows; ++r) {
            const uint row = first_query + gl_SubgroupID * kQueries + own_row(r);
            [[unroll]] for (uint part = 0; part < kMatN / 8; ++part) {
                const uint c = piece * (kMatN / 8) + part, at = own_at + own_row(r) * kWeightPitch + 2 * part;
                if (own_row(r) >= kQueries || row >= p.rows || c >= kChunks)
                    continue;
                const vec4 lo = uintBitsToFloat(weights[at]) * inverse[r];
                const vec4 hi = uintBitsToFloat(weights[at + 1]) * inverse[r];
                STORE8(y, kTypeY, y_at + row * p.y_ld + c * 8, lo, hi);
            }
        }
    }
}
