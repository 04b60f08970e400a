// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// a row of the table of frames; a camera's centre is kept as whole voxels and a rest, so that positions far from the
// origin lose nothing
const uint kFrameWords = 24;

struct TsdfFrame {
    vec2 focal, center;   // pixels
    mat3 world_to_camera; // rotation, columns
    ivec3 at;             // of the camera, whole voxels from the box's lowest corner
    vec3 rest;            // voxels
    uint width, height;   // 0: no frame
    uint first;           // pixel
};

#define LOAD_FRAME(words, row, f)                                                                                      \
    {                                                                                                                  \
        const uint o = (row) * kFrameWords;                                                                            \
        f.focal = vec2(words[o], words[o + 1]);                                                                        \
        f.center = vec2(words[o + 2], words[o + 3]);                                                                   \
        f.world_to_camera = transpose(mat3(words[o + 4], words[o + 5], words[o + 6], words[o + 7], words[o + 8],       \
                                           words[o + 9], words[o + 10], words[o + 11], words[o + 12]));                \
        f.at = floatBitsToInt(vec3(words[o + 13], words[o + 14], words[o + 15]));                                      \
        f.rest = vec3(words[o + 16], words[o + 17], words[o + 18]);                                                    \
        f.width = floatBitsToUint(words[o + 19]);                                                                      \
        f.height = floatBitsToUint(words[o + 20]);                                                                     \
        f.first = floatBitsToUint(words[o + 21]);                                                                      \
    }

// row of the frame that holds a pixel of the batch; `frames` if there is none
#define FRAME_OF_PIXEL(words, frames, pixel, row)                                                                      \
    for (row = 0; row < frames; ++row) {                                                                               \
        const uint o = row * kFrameWords;                                                                              \
        const uint first = floatBitsToUint(words[o + 21]);                                                             \
        const uint count = floatBitsToUint(words[o + 19]) * floatBitsToUint(words[o + 20]);                            \
        if (pixel >= first && pixel - first < count)                                                                   \
            break;                                                                                                     \
    }
