// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// where an output pixel finds its input pixels
struct ConvPixel {
    int y, x; // of the first tap, in the upsampled input; far outside for padding rows
    uint base; // first row of its image in x
};

ConvPixel conv_pixel(uint row)
{
    const uint at = min(row, p.rows - 1) + p.first_row;
    const uint image = at / p.image_rows, pixel = at % p.image_rows;
    const ivec2 first = ivec2(pixel / p.out_width, pixel % p.out_width) * int(p.stride) - ivec2(p.padding_y, p.padding_x);
    return ConvPixel(pixel < p.out_pixels ? first.x : -1000000, first.y, image * p.in_image_rows);
}

// row of x that a tap reads, before what is bound; false: zeros
bool conv_tap(ConvPixel pixel, uint tap_y, uint tap_x, out uint row)
{
    const int y = pixel.y + int(tap_y), x = pixel.x + int(tap_x);
    const bool inside = uint(y) < p.seen_height && uint(x) < p.seen_width; // negative ones wrap around
    row = inside ? pixel.base + (uint(y) >> p.shift) * p.in_width + (uint(x) >> p.shift) : 0;
    return inside;
}
