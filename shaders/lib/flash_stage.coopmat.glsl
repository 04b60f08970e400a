// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// What flash_attention.coopmat.comp reads, through shared memory: queries once, keys and values block by block.

// channels behind the head's are never written again
void clear_padding_channels()
{
    for (uint key = gl_LocalInvocationID.x; key < kKeys; key += kThreads) {
        for (uint c = kChunks; c < kKeyPitch; ++c)
            tile[key * kKeyPitch + c] = uvec4(0);
        for (uint c = kChunks; c < kValuePitch; ++c)
            tile[kValuesAt + key * kValuePitch + c] = uvec4(0);
    }
}

// through shared memory to registers
void load_queries(uint image, uint first, uint column)
{
    const uint last = max(p.queries, p.first_row + 1) - p.first_row - 1; // rows behind it repeat it
    barrier();
    for (uint i = gl_LocalInvocationID.x; i < 4 * kQueries * (kDim / 8); i += kThreads) {
        const uint row = i / (kDim / 8), c = i % (kDim / 8), at = image * p.query_rows + min(first + row, last);
        tile[row * kKeyPitch + c] = c < kChunks ? q[(at * p.q_ld + column) / 8 + c] : uvec4(0);
    }
    barrier();
    [[unroll]] for (uint i = 0; i < kDown; ++i)
        [[unroll]] for (uint k = 0; k < kSteps; ++k)
            coopMatLoad(queries[i * kSteps + k], tile,
                        (gl_SubgroupID * kQueries + i * kMatM) * kKeyPitch + k * kMatK / 8, kKeyPitch,
                        gl_CooperativeMatrixLayoutRowMajor);
    barrier();
    clear_padding_channels();
}

// Keys behind the last one repeat it, and no weight is larger for them; their values and 1 are zeros.
void load_block(uint image, uint first, uint head)
{
    [[unroll]] for (uint n = 0; n < kLoads; ++n) {
        const uint i = n * kThreads + gl_LocalInvocationID.x, key = first + i / kChunks;
        const uint at = (image * p.key_rows + min(key, p.keys - 1)) * p.kv_ld + head;
        next_keys[n] = kv[(at + p.k_col) / 8 + i % kChunks];
        next_values[n] = key < p.keys ? kv[(at + p.v_col) / 8 + i % kChunks] : uvec4(0);
    }
}

void stage_block(uint first)
{
    [[unroll]] for (uint n = 0; n < kLoads; ++n) {
        const uint i = n * kThreads + gl_LocalInvocationID.x;
        if (kKeys * kChunks % kThreads == 0 || i < kKeys * kChunks) {
            tile[i / kChunks * kKeyPitch + i % kChunks] = next_keys[n];
            tile[kValuesAt + i / kChunks * kValuePitch + i % kChunks] = next_values[n];
        }
    }
    if (first == 0 || first + kKeys > p.keys)
        for (uint key = gl_LocalInvocationID.x; key < kKeys; key += kThreads)
            tile[kValuesAt + key * kValuePitch + kChunks].x = first + key < p.keys ? 0x3c00 : 0; // 1
}
