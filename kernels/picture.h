// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/network.h"
#include "kernels/splat.h"

// Ops between pictures and networks, as those in kernels/network.h. Numbers are rounded to the last bit as the host
// rounds them (shaders/lib/rounding.glsl), so that it makes no difference whether a picture went through a file.
namespace semrover {

// what splats look like in files: [P] u32 arrays
struct PixelWords {
    Tensor seen;    // red, green, blue over the background; 255 where it is visible, else 0
    Tensor depths;  // whole units, 0 from 65534.5 on, or fp32 metres; 0 for nothing
    Tensor normals; // 128 + 127 n of each axis; label, 255 for none
};
struct SplatPixelsOptions {
    std::array<uint8_t, 3> background{};
    float visible_alpha = 0.5f; // from which on a pixel is visible
    float depth_units = 1000;   // to a metre; 0: fp32 metres
};
[[nodiscard]] PixelWords splat_pixels(Graph& g, const SplatImages& images, const SplatPixelsOptions& options);

// How a picture of splats lies in memory: as splat() makes it, or as an image of a format has it; or it is not wanted.
// The shader knows the values.
enum class Texels : uint32_t {
    none,
    whole,
    unorm8, // four numbers, cut to 0..1: 255 v, halves up
    snorm8, // three, cut to -1..1: 127 v, halves away from 0; a fourth of 0
    half4,  // four, the nearest, ties to even; and so on
    float4,
    half1, // the first
    float1,
    byte, // the first, of labels: 255 from there on
    word  // likewise, all of it
};
struct PictureFormat {
    Texels texels = Texels::whole;
    bool linear = false; // light in place of sRGB numbers: r, g, b = alpha light(v / alpha)
    bool scaled = false; // the first number z as scale / z + offset, cut to 0..1; offset where it is 0
    bool operator==(const PictureFormat&) const = default;
};
uint32_t texel_bytes(Texels texels); // of a pixel; 0 for none and whole
inline uint32_t texel_words(Texels texels, uint32_t pixels)
{
    return uint32_t((uint64_t(pixels) * texel_bytes(texels) + 3) / 4);
}
// pictures begin with whole words; zeros fill their last ones
[[nodiscard]] Tensor splat_texels(Graph& g,
                                  Tensor x,                                      // of SplatImages
                                  uint32_t cameras, const PictureFormat& format, // neither none nor whole
                                  Tensor scale = {}); // [1, 2] fp32 where it is scaled -> [cameras * words] u32 array

// a picture and the blocks that cover it: it goes on with its last column and row where they are not full
struct PictureShape {
    uint32_t width = 0, height = 0;               // pixels
    uint32_t padded_width = 0, padded_height = 0; // of whole blocks
};

// y = seen / 127.5 - 1 of red, green and blue: what a VAE encodes; zeros in the padding rows of the image
[[nodiscard]] FeatureMap picture_input(Graph& g,
                                       Tensor seen,                // [height * width] u32 array, as PixelWords has it
                                       const PictureShape& shape); // [padded pixels, 3] fp32

// y = share of the pixels of a block that are visible
[[nodiscard]] Tensor block_shares(Graph& g,
                                  Tensor seen, // [height * width] u32 array, as PixelWords has it
                                  const PictureShape& shape,
                                  uint32_t block); // pixels on a side -> [blocks, padded as an image's rows] fp32 array

// y = (x - shift) factor of the first `cols` columns; back: y = x / factor + shift. Zeros in rows from `pixels` on.
struct LatentScale {
    float factor = 1, shift = 0;
    bool back = false;
};
[[nodiscard]] Tensor scale_latent(Graph& g,
                                  Tensor x,                                                  // [M, cols or more] fp32
                                  uint32_t pixels, uint32_t cols, const LatentScale& scale); // [M, cols] fp32

// bytes of a picture, red, green, blue, line by line: (x + 1) 127.5, rounded and cut to 0..255
[[nodiscard]] Tensor picture_bytes(Graph& g,
                                   Tensor x,                   // [padded pixels, 3] fp32
                                   const PictureShape& shape); // [words] u32 array of 3 * width * height bytes
constexpr uint32_t picture_words(uint32_t width, uint32_t height)
{
    return divide_up(3 * width * height, 4);
}

// the same as four bytes a pixel, the fourth 255: what an image of R8G8B8A8 holds
[[nodiscard]] Tensor picture_texels(Graph& g,
                                    Tensor bytes,     // [words] u32 array, as picture_bytes() makes it
                                    uint32_t pixels); // [pixels] u32 array

// A frame and what its depth says of the frame before (temporal accumulation; docs/method.md §6.5): where both see the
// same surface, a share of the frame before
struct FrameAndDepth {
    Tensor bytes; // [picture_words()] u32 array
    Tensor depth; // [height * width] fp32 array: metres; 0: infinitely far away
};
struct AccumulateOptions {
    uint32_t width = 0, height = 0;
    SplatLens lens = SplatLens::pinhole; // of both cameras
    bool moving = false;                 // one moves while it is read out, at least; no pinholes
    float share = 0;                     // of the frame before, 0..1
    float tolerance = 0.02f;             // relative, of the depth at which the frame before shows the surface
    float spread = 2; // the frame before is cut to this many standard deviations of the 3 x 3 pixels around
};
[[nodiscard]] Tensor accumulate(Graph& g,
                                Tensor cameras, // [2, kLensCameraFloats] fp32 as of splat(): of `now`, where the world
                                                // is its own (still) frame, and of `past`
                                const FrameAndDepth& now, const FrameAndDepth& past,
                                const AccumulateOptions& options); // -> [picture_words()] u32 array

// Optical flow from one picture of splats to the next (docs/method.md §5.5): where the surface that a pixel shows at
// its median depth is then. What moves is moved.
enum class FlowState : uint32_t {
    nothing, // the pixel shows nothing
    seen,
    hidden, // something else is nearer then, or it is not there any more
    outside // it leaves the picture
};
constexpr float kUnknownFlow = 1e10f; // of both numbers: the next lens cannot see it, or there is nothing
struct FlowSource {
    Tensor depth;  // [height * width, 2] fp32, of SplatImages
    Tensor owners; // [height * width] u32, likewise
};
// from this camera's (still) frame to the next's
struct FlowMoves {
    Tensor moves;     // [1 + movers, 12] fp32: of what stands, then of each mover; zeros: it is not there then
    Tensor rows = {}; // [numbers] u32, or none: SplatOptions::mover_rows
};
struct FlowOptions {
    uint32_t width = 0, height = 0;
    SplatLens lens = SplatLens::pinhole; // of both cameras
    bool moving = false;                 // one moves while it is read out, at least; no pinholes
    float tolerance = 0.02f;             // relative, by which a hidden surface is farther than what is seen there
};
struct FlowTensors {
    Tensor flow;   // [height * width, 2] fp32: pixels to the right and down
    Tensor states; // [height * width] u32: FlowState
};
[[nodiscard]] FlowTensors splat_flow(Graph& g,
                                     Tensor cameras, // [2, kLensCameraFloats] fp32: lenses of this picture and the next
                                     const FlowMoves& moves, const FlowSource& now, Tensor next_depth,
                                     const FlowOptions& options);

// index of the first number that is NaN or infinite, 2^32 - 1 for none: counted over the picture's own pixels
[[nodiscard]] Tensor first_non_finite(Graph& g,
                                      Tensor x,                   // [padded pixels, N] fp32
                                      const PictureShape& shape); // [1] u32

} // namespace semrover
