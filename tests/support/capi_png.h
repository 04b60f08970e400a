/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Pictures of tests in C as PNG files. */
#ifndef SEMROVER_TESTS_CAPI_PNG_H
#define SEMROVER_TESTS_CAPI_PNG_H

#include "tests/support/capi_vulkan.h"

#include <png.h>

/* without a jump buffer of ours libpng aborts where something is wrong */
static inline void write_png(const char* path, uint32_t width, uint32_t height, int color_type, int bits,
                             const void* pixels)
{
    const size_t row = (size_t)width * (color_type == PNG_COLOR_TYPE_RGB ? 3 : 1) * (size_t)bits / 8;
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
    png_infop info = png_create_info_struct(png);
    FILE* file = fopen(path, "wb");
    uint32_t y;
    CHECK(file && png && info);
    png_init_io(png, file);
    png_set_IHDR(png, info, width, height, bits, color_type, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
                 PNG_FILTER_TYPE_DEFAULT);
    png_write_info(png, info);
    if (bits == 16)
        png_set_swap(png); /* files have the high byte first */
    for (y = 0; y < height; ++y)
        png_write_row(png, (png_const_bytep)pixels + y * row);
    png_write_end(png, NULL);
    png_destroy_write_struct(&png, &info);
    CHECK(fclose(file) == 0);
}

/* a file of this type and as many bits; 16 bits as the machine has them */
static inline void read_png_of(const char* path, uint32_t width, uint32_t height, int color_type, int bits,
                               void* pixels)
{
    const size_t row = (size_t)width * (color_type == PNG_COLOR_TYPE_RGB ? 3 : 1) * (size_t)bits / 8;
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
    png_infop info = png_create_info_struct(png);
    FILE* file = fopen(path, "rb");
    uint32_t y;
    CHECK(file && png && info);
    png_init_io(png, file);
    png_read_info(png, info);
    CHECK(png_get_image_width(png, info) == width && png_get_image_height(png, info) == height);
    CHECK(png_get_color_type(png, info) == color_type && png_get_bit_depth(png, info) == bits);
    if (bits == 16)
        png_set_swap(png);
    for (y = 0; y < height; ++y)
        png_read_row(png, (png_bytep)pixels + y * row, NULL);
    png_destroy_read_struct(&png, &info, NULL);
    fclose(file);
}
/* red, green and blue of a file that has 8 bits of each */
static inline void read_png(const char* path, uint32_t width, uint32_t height, uint8_t* pixels)
{
    read_png_of(path, width, height, PNG_COLOR_TYPE_RGB, 8, pixels);
}

#endif
