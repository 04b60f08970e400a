// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// Rows of a weight W, whose type is its own and whose rows are p.w_ld elements apart. To be included after kTypeW and
//   WEIGHT(i)  texel i of W
// A row of q8_0 is its int8, then, from a texel of their own on, the fp16 scales of its blocks of 32. So values are read
// in whole texels, as other types are, and a texel of scales serves 256 columns, which follow each other in a loop over K;
// a row is whole, so that W stays one binding and may be cut between any rows. With a scale beside each block, as files of
// other programs have it, blocks of 34 bytes would begin in the middle of words.

// texel that a row begins with
uint weight_row(uint row)
{
    const uint texels = kTypeW == kQ8_0 ? p.w_ld / 16 + (p.w_ld + 255) / 256 : p.w_ld / (kTypeW == kF16 ? 8 : 4);
    return row * texels;
}

vec4 signed_bytes(uint word)
{
    const int w = int(word);
    return vec4(bitfieldExtract(w, 0, 8), bitfieldExtract(w, 8, 8), bitfieldExtract(w, 16, 8), bitfieldExtract(w, 24, 8));
}

// of the block that column k of a row lies in
float block_scale(uint row_at, uint k)
{
    return unpackHalf2x16(WEIGHT(row_at + p.w_ld / 16 + k / 256)[k / 64 % 4])[k / 32 % 2];
}

// eight int8 from k on, a multiple of 8
uvec2 block_words(uint row_at, uint k)
{
    const uvec4 texel = WEIGHT(row_at + k / 16);
    const uvec2 first = texel.xy, second = texel.zw;
    return k % 16 == 0 ? first : second;
}

// eight elements of a row from k on, a multiple of 8. Products of an int8 and an fp16 number are exact in fp32.
void load_weight8(uint row_at, uint k, out vec4 lo, out vec4 hi)
{
    if (kTypeW == kQ8_0) {
        const uvec2 words = block_words(row_at, k);
        const float scale = block_scale(row_at, k);
        lo = scale * signed_bytes(words.x);
        hi = scale * signed_bytes(words.y);
    } else {
        UNPACK8(kTypeW, WEIGHT(row_at + k / 8), WEIGHT(row_at + k / 4), WEIGHT(row_at + k / 4 + 1), lo, hi)
    }
}
