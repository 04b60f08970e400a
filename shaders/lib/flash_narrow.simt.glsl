// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// flash_attention.simt for heads of 40 and fewer: each of the eight threads of a query has its own softmax, over every
// eighth key, so no thread is idle, weights stay in registers, and a block of keys costs two barriers instead of five.
// The eight sums are joined at the end.

const uint kNarrowPitch = kChunks | 1;        // odd: keys of a slab start in different banks
const uint kNarrowSlab = kKeys * kMostNarrow; // of `slabs`: keys' lower and upper halves, then values'
const uint kJoinPitch = kParts + 1;           // of the parts of a query, likewise

// keys and values of rows [first, first + kKeys), clamped to the image's
void stage_narrow(uint first, uint head)
{
    barrier(); // the last ones may still be read
    for (uint i = gl_LocalInvocationID.x; i < 2 * kKeys * kChunks; i += kThreads) {
        const uint of_values = i / (kKeys * kChunks), key = i / kChunks % kKeys, c = i % kChunks;
        const uint row = gl_WorkGroupID.z * p.key_rows + min(first + key, p.keys - 1);
        const uint column = (of_values != 0 ? p.v_col : p.k_col) + head;
        vec4 lo, hi;
        LOAD8(kv, kTypeKv, row * p.kv_ld + column + c * 8, lo, hi);
        const uint at = of_values * 2 * kNarrowSlab + key * kNarrowPitch + c;
        slabs[at] = lo;
        slabs[at + kNarrowSlab] = hi;
    }
    barrier();
}

// base-2 logarithms of the weights of this thread's keys
void narrow_scores(uint first, uint q_at[kOwn], uint part, out float s[kOwn][kOwnKeys])
{
    [[unroll]] for (uint n = 0; n < kOwn; ++n)
        [[unroll]] for (uint j = 0; j < kOwnKeys; ++j)
            s[n][j] = 0.0;
    [[dont_unroll]] for (uint c = 0; c < kChunks; ++c) {
        vec4 lo[kOwn], hi[kOwn];
        [[unroll]] for (uint n = 0; n < kOwn; ++n)
            LOAD8(q, kTypeQ, q_at[n] + c * 8, lo[n], hi[n]);
        [[unroll]] for (uint j = 0; j < kOwnKeys; ++j) {
            const uint at = (part + j * kParts) * kNarrowPitch + c;
            [[unroll]] for (uint n = 0; n < kOwn; ++n)
                s[n][j] += dot(lo[n], slabs[at]) + dot(hi[n], slabs[at + kNarrowSlab]);
        }
    }
    [[unroll]] for (uint n = 0; n < kOwn; ++n)
        [[unroll]] for (uint j = 0; j < kOwnKeys; ++j)
            s[n][j] = first + part + j * kParts < p.keys ? s[n][j] * p.scale : -1e30;
}

// s becomes the weights
void narrow_softmax(inout float s[kOwn][kOwnKeys], inout float largest[kOwn], inout float total[kOwn],
                    out float shrink[kOwn])
{
    [[unroll]] for (uint n = 0; n < kOwn; ++n) {
        float m = largest[n];
        [[unroll]] for (uint j = 0; j < kOwnKeys; ++j)
            m = max(m, s[n][j]);
        shrink[n] = exp2(largest[n] - m);
        largest[n] = m;
        total[n] *= shrink[n];
        [[unroll]] for (uint j = 0; j < kOwnKeys; ++j) {
            s[n][j] = exp2(s[n][j] - m);
            total[n] += s[n][j];
        }
    }
}

void attend_narrow(uint first_query)
{
    const uint part = gl_LocalInvocationID.x % kParts, query = gl_LocalInvocationID.x / kParts * kOwn;
    const uint head = gl_WorkGroupID.y * kChunks * 8, image = gl_WorkGroupID.z;
    uint q_at[kOwn];
    float largest[kOwn], total[kOwn], shrink[kOwn], s[kOwn][kOwnKeys];
    vec4 o_lo[kMostNarrow][kOwn], o_hi[kMostNarrow][kOwn];
    [[unroll]] for (uint n = 0; n < kOwn; ++n) {
        q_at[n] = query_at(first_query + query + n) + head;
        largest[n] = -1e30;
        total[n] = 0.0;
        [[unroll]] for (uint c = 0; c < kMostNarrow; ++c)
            o_lo[c][n] = o_hi[c][n] = vec4(0.0);
    }
    for (uint first = 0; first < p.keys; first += kKeys) {
        stage_narrow(first, head);
        narrow_scores(first, q_at, part, s);
        narrow_softmax(s, largest, total, shrink);
        [[unroll]] for (uint c = 0; c < kMostNarrow; ++c) {
            if (c >= kChunks)
                continue;
            [[unroll]] for (uint n = 0; n < kOwn; ++n) {
                o_lo[c][n] *= shrink[n];
                o_hi[c][n] *= shrink[n];
            }
            [[unroll]] for (uint j = 0; j < kOwnKeys; ++j) {
                const uint at = 2 * kNarrowSlab + (part + j * kParts) * kNarrowPitch + c;
                [[unroll]] for (uint n = 0; n < kOwn; ++n) {
                    o_lo[c][n] += s[n][j] * slabs[at];
                    o_hi[c][n] += s[n][j] * slabs[at + kNarrowSlab];
                }
            }
        }
    }
    // the largest score of a query: by its own a part may have had no key at all
    [[unroll]] for (uint n = 0; n < kOwn; ++n)
        part_largest[(query + n) * (kParts + 1) + part] = largest[n];
    barrier();
    [[unroll]] for (uint n = 0; n < kOwn; ++n)
        shrink[n] = exp2(largest[n] - largest_of(query + n));
    [[unroll]] for (uint n = 0; n < kOwn; ++n)
        shrink[n] /= sum_of_parts(query + n, part, total[n] * shrink[n]);
    const uint own = gl_LocalInvocationID.x, row = first_query + own; // the query that this thread writes
    [[unroll]] for (uint c = 0; c < kMostNarrow; ++c) {
        if (c >= kChunks)
            continue;
        barrier();
        [[unroll]] for (uint n = 0; n < kOwn; ++n) {
            slabs[(query + n) * kJoinPitch + part] = o_lo[c][n] * shrink[n];
            slabs[(kQueries + query + n) * kJoinPitch + part] = o_hi[c][n] * shrink[n];
        }
        barrier();
        if (own < kQueries && row < p.rows) {
            vec4 lo = vec4(0.0), hi = vec4(0.0);
            [[unroll]] for (uint i = 0; i < kParts; ++i) {
                lo += slabs[own * kJoinPitch + i];
                hi += slabs[(kQueries + own) * kJoinPitch + i];
            }
            STORE8(y, kTypeY, (image * p.query_rows + row) * p.y_ld + head + c * 8, lo, hi);
        }
    }
}
