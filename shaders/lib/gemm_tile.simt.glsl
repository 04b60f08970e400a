// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// kTileM x kTileM outputs of a workgroup of 64 threads: 64 x 64, or 32 x 32 where a large GPU would have fewer workgroups
// than units. The planner chooses (kTileM and kTileN alike); both give the same bits, as K is summed in one order. 16
// columns of K at a time in shared memory.
const uint kTileK = 16;               // columns of K in shared memory
const uint kPitch = 68;              // floats of a row of 64; keeps vec4 alignment, spreads transposing stores over banks
const uint kOwn = kTileM / 8;        // rows and columns that a thread sums: 8 x 8 or 4 x 4
const uint kAcross = kTileM / 8;     // threads side by side when sums are stored, eight columns each
const uint kRows = kTileM * kTileM / 512; // rows that a thread stores: 8 or 2
const uint kBring = kTileK * kTileM / 256;          // fours of columns that a thread brings: 4 or 2
const uint kTileX = 0, kTileW = kTileK * kPitch;
shared float tile[2 * kTileK * kPitch]; // [k][row] of x, [k][col] of w

// kOwn rows from kOwn (thread / 8) on. While sums are made, four columns from 4 (thread % 8) on and in the larger tile
// four 32 further: so eight threads read 32 floats next to each other, one from each of 32 banks. store_tile() first
// changes that to eight columns from 8 (thread % kAcross) on.
float acc[8][8];

// note: bitfieldExtract tells compilers what a quotient hides, that the product is a multiple of 8: they read four floats
// at once
uint thread_row() { return bitfieldExtract(gl_LocalInvocationID.x, 3, 3) * kOwn; }
uint thread_quad() { return bitfieldExtract(gl_LocalInvocationID.x, 0, 3) * 4; }

// which row of x and of w this thread brings, and from which column of the step on
uint bring_row() { return gl_LocalInvocationID.x % kTileM; }
uint bring_k() { return gl_LocalInvocationID.x / kTileM * 4 * kBring; }

void clear_tile()
{
    [[unroll]] for (uint i = 0; i < kOwn; ++i)
        [[unroll]] for (uint j = 0; j < kOwn; ++j)
            acc[i][j] = 0.0;
}

void stage(vec4 a[4], vec4 b[4])
{
    [[unroll]] for (uint i = 0; i < 4 * kBring; ++i) {
        tile[kTileX + (bring_k() + i) * kPitch + bring_row()] = a[i / 4][i % 4];
        tile[kTileW + (bring_k() + i) * kPitch + bring_row()] = b[i / 4][i % 4];
    }
}

void multiply()
{
    const uint tm = kTileX + thread_row(), tn = kTileW + thread_quad();
    [[unroll]] for (uint s = 0; s < kTileK; ++s) {
        float u[8], v[8];
        [[unroll]] for (uint i = 0; i < kOwn; ++i) {
            u[i] = tile[s * kPitch + tm + i];
            v[i] = tile[s * kPitch + tn + i % 4 + i / 4 * 32];
        }
        [[unroll]] for (uint i = 0; i < kOwn; ++i)
            [[unroll]] for (uint j = 0; j < kOwn; ++j)
                acc[i][j] += u[i] * v[j];
    }
}

// row of the tile and first of the eight columns that this thread stores
uint own_row() { return gl_LocalInvocationID.x / kAcross * kRows; }
uint own_col() { return gl_LocalInvocationID.x % kAcross * 8; }

// the smaller tile lies in shared memory as a whole: 4 x 4 sums of a thread become 2 x 8
void join_small_tile()
{
    barrier();
    [[unroll]] for (uint i = 0; i < kOwn; ++i)
        [[unroll]] for (uint j = 0; j < kOwn; ++j)
            tile[(thread_row() + i) * kTileM + thread_quad() + j] = acc[i][j];
    barrier();
    [[unroll]] for (uint i = 0; i < kRows; ++i)
        [[unroll]] for (uint j = 0; j < 8; ++j)
            acc[i][j] = tile[(own_row() + i) * kTileM + own_col() + j];
}

// to eight columns next to each other, for stores of eight: through shared memory, four rows of each thread at a time
void join_columns()
{
    if (kTileM == 32) {
        join_small_tile();
        return;
    }
    [[unroll]] for (uint half_of = 0; half_of < 2; ++half_of) {
        barrier();
        [[unroll]] for (uint i = 0; i < 4; ++i)
            [[unroll]] for (uint j = 0; j < 8; ++j)
                tile[(thread_row() / 2 + i) * 64 + thread_quad() + j % 4 + j / 4 * 32] = acc[4 * half_of + i][j];
        barrier();
        [[unroll]] for (uint i = 0; i < 4; ++i)
            [[unroll]] for (uint j = 0; j < 8; ++j)
                acc[4 * half_of + i][j] = tile[(thread_row() / 2 + i) * 64 + 2 * thread_quad() + j];
    }
}

// the neighbour holds the gates of this thread's columns; every thread must call it
void multiply_by_neighbors_gate(inout vec4 lo, inout vec4 hi)
{
    const uint at = gl_LocalInvocationID.x * 8, gate = (gl_LocalInvocationID.x | 1) * 8;
    barrier();
    [[unroll]] for (uint i = 0; i < 4; ++i) {
        tile[at + i] = lo[i];
        tile[at + 4 + i] = hi[i];
    }
    barrier();
    lo *= gelu_erf(vec4(tile[gate], tile[gate + 1], tile[gate + 2], tile[gate + 3]));
    hi *= gelu_erf(vec4(tile[gate + 4], tile[gate + 5], tile[gate + 6], tile[gate + 7]));
}

// Two threads hold the 16 rows of a moment: the second one's are merged into the first's. Threads from `threads` on hold
// none. Every thread must call it.
void merge_moments(uint threads, uint row, uint col, ColumnMoments m)
{
    const uint thread = gl_LocalInvocationID.x, other = (thread + kAcross) % threads;
    vec4 mean[2], m2[2];
    column_moments(m, mean, m2);
    barrier();
    [[unroll]] for (uint i = 0; i < 8; ++i) {
        tile[kTileX + thread * 16 + i] = mean[i / 4][i % 4];
        tile[kTileX + thread * 16 + 8 + i] = m2[i / 4][i % 4];
    }
    tile[kTileW + thread] = float(m.count);
    barrier();
    if (thread >= threads || thread / kAcross % 2 != 0 || row >= p.rows || col >= p.cols)
        return;
    const float n_a = float(m.count), n_b = tile[kTileW + other], share = n_b / max(n_a + n_b, 1.0);
    [[unroll]] for (uint i = 0; i < 2; ++i) {
        vec4 mean_b, m2_b;
        [[unroll]] for (uint j = 0; j < 4; ++j) {
            mean_b[j] = tile[kTileX + other * 16 + 4 * i + j];
            m2_b[j] = tile[kTileX + other * 16 + 8 + 4 * i + j];
        }
        const vec4 delta = mean_b - mean[i];
        mean[i] += delta * share;
        m2[i] += m2_b + delta * delta * n_a * share;
    }
    write_moments(row, col, mean, m2);
}

// of the smaller tile, whose finished values are in acc: a thread takes eight rows, as it has them in the larger one
void store_small_moments(uint tile_row, uint tile_col)
{
    const uint thread = gl_LocalInvocationID.x, threads = kTileM / 8 * kAcross;
    barrier();
    [[unroll]] for (uint i = 0; i < kRows; ++i)
        [[unroll]] for (uint j = 0; j < 8; ++j)
            tile[(own_row() + i) * kTileM + own_col() + j] = acc[i][j];
    barrier();
    const uint row = thread % threads / kAcross * 8;
    ColumnMoments m = no_moments();
    [[unroll]] for (uint i = 0; i < 8; ++i) {
        const uint at = (row + i) * kTileM + own_col();
        if (thread < threads && tile_col + own_col() < p.cols && counts_in_moments(tile_row + row + i))
            add_moments(m, vec4(tile[at], tile[at + 1], tile[at + 2], tile[at + 3]),
                        vec4(tile[at + 4], tile[at + 5], tile[at + 6], tile[at + 7]));
    }
    merge_moments(threads, tile_row + row, tile_col + own_col(), m);
}

// row, col: of the workgroup's tile
void store_tile(uint tile_row, uint tile_col)
{
    const uint row = tile_row + own_row(), col = tile_col + own_col();
    ColumnMoments m = no_moments();
    join_columns();
    [[unroll]] for (uint i = 0; i < kRows; ++i) {
        bool inside = row + i < p.rows && col < p.cols;
        vec4 lo = vec4(acc[i][0], acc[i][1], acc[i][2], acc[i][3]), hi = vec4(acc[i][4], acc[i][5], acc[i][6], acc[i][7]);
        if (inside)
            activate8(row + i, col, lo, hi);
        if (kGeglu) {
            multiply_by_neighbors_gate(lo, hi);
            inside = inside && gl_LocalInvocationID.x % 2 == 0;
        }
        if (inside)
            finish8(row + i, kGeglu ? tile_col / 2 + own_col() / 2 : col, kGeglu ? p.cols / 2 : p.cols, lo, hi);
        if (kMoments && kTileM == 32) {
            [[unroll]] for (uint j = 0; j < 4; ++j) {
                acc[i][j] = lo[j];
                acc[i][4 + j] = hi[j];
            }
        } else if (kMoments && inside && counts_in_moments(row + i)) {
            add_moments(m, lo, hi);
        }
    }
    if (kMoments && kTileM == 32)
        store_small_moments(tile_row, tile_col);
    else if (kMoments)
        merge_moments(64, row, col, m);
}
