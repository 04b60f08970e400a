// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// What a workgroup does with one stage of shared memory. Included once a stage, with names of its own (STAGE_X, STAGE_W,
// STORE_STAGE, MULTIPLY_STAGE): of arrays with names, compilers know that a store to one leaves the other as it is.

// what this thread has loaded
void STORE_STAGE()
{
    [[unroll]] for (uint i = 0; i < kLoadsX; ++i)
        if (kTileM * kTileK / 8 % kThreads == 0 || load_row(i) < kTileM)
            STAGE_X[(load_row(i) * kPitch + load_k()) / 8] = next_x[i];
    [[unroll]] for (uint i = 0; i < kLoadsW; ++i)
        if (kTileN * kTileK / 8 % kThreads == 0 || load_row(i) < kTileN)
            STAGE_W[(load_row(i) * kPitch + load_k()) / 8] = next_w[i];
}

#define LOAD_X(a, i, k)                                                                                                \
    coopMatLoad(a, STAGE_X, ((part_row() + (i) * kMatM) * kPitch + (k)) / 8, kPitch / 8,                              \
                gl_CooperativeMatrixLayoutRowMajor)
#define LOAD_W(b, j, k)                                                                                                \
    coopMatLoad(b, STAGE_W, ((part_col() + (j) * kMatN) * kPitch + (k)) / 8, kPitch / 8,                              \
                gl_CooperativeMatrixLayoutColumnMajor)

void MULTIPLY_STAGE()
{
    if (kAhead) {
        MatrixX a[2 * kMatsDown];
        MatrixW b[2 * kMatsAcross];
        [[unroll]] for (uint k = 0; k < kTileK + kMatK; k += kMatK) {
            const uint next = k / kMatK % 2;
            if (k < kTileK) {
                [[unroll]] for (uint i = 0; i < kMatsDown; ++i)
                    LOAD_X(a[next * kMatsDown + i], i, k);
                [[unroll]] for (uint j = 0; j < kMatsAcross; ++j)
                    LOAD_W(b[next * kMatsAcross + j], j, k);
            }
            if (k > 0)
                [[unroll]] for (uint n = 0; n < kMatsDown * kMatsAcross; ++n)
                    sums[n] = coopMatMulAdd(a[(1 - next) * kMatsDown + n / kMatsAcross],
                                            b[(1 - next) * kMatsAcross + n % kMatsAcross], sums[n]);
        }
        return;
    }
    [[unroll]] for (uint k = 0; k < kTileK; k += kMatK) {
        MatrixX a[kMatsDown];
        [[unroll]] for (uint i = 0; i < kMatsDown; ++i)
            LOAD_X(a[i], i, k);
        [[unroll]] for (uint j = 0; j < kMatsAcross; ++j) {
            MatrixW b;
            LOAD_W(b, j, k);
            [[unroll]] for (uint i = 0; i < kMatsDown; ++i)
                sums[i * kMatsAcross + j] = coopMatMulAdd(a[i], b, sums[i * kMatsAcross + j]);
        }
    }
}

#undef LOAD_X
#undef LOAD_W
#undef STAGE_X
#undef STAGE_W
#undef STORE_STAGE
#undef MULTIPLY_STAGE
