// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/depth_picture.h"
#include "engine/format/flow_picture.h"
#include "engine/format/image.h"
#include "engine/format/number_image.h"
#include "tests/fuzz/fuzz_target.h"
#include "tools/dataset/depth_image.h"

namespace semrover::fuzz {

namespace pictures {

constexpr uint64_t kMostPixels = 16 << 20; // larger ones take the time of many

void png(Bytes input)
{
    (void)accepts(png_info(input, "p.png"));
    (void)accepts(decode_image_rgb8(input, "p.png", kMostPixels));
    (void)accepts(decode_image_with_alpha(input, "p.png", kMostPixels));
    (void)accepts(decode_png_numbers(input, "p.png", kMostPixels));
}

void png16(Bytes input)
{
    const InputFile file(input, "p.png");
    if (const auto size = read_image_size(file); accepts(size) && uint64_t(size->width) * size->height > kMostPixels)
        return;
    (void)accepts(read_png_gray16(file));
    (void)accepts(read_png_rgb16(file));
    (void)accepts(read_flow_png(file));
}

void jpeg(Bytes input)
{
    (void)accepts(jpeg_size(input, "p.jpg"));
    (void)accepts(decode_jpeg_rgb8(input, "p.jpg", kMostPixels));
}

void number_picture(Bytes input)
{
    (void)accepts(decode_array_image(input, "p.npy"));
    const InputFile file(input, "p.npy");
    if (const auto size = number_image_size(file); !accepts(size) || uint64_t(size->width) * size->height > kMostPixels)
        return;
    (void)accepts(read_label_image(file));
    (void)accepts(read_depth_picture(file, kMillimetre));
    (void)accepts(read_depth_image(file));
}

constexpr FuzzTarget kTargets[] = {
    {"png", "*.png", png, 8 << 10, 3 * 1032 + 2, 128 * kMebibyte},
    {"png16", "*.png", png16, 8 << 10, 6 * 1032 + 2, 128 * kMebibyte},
    {"jpeg", "*.jpg *.jpeg", jpeg, 8 << 10, 11 * 1024, 64 * kMebibyte},
    {"number_picture", "*.png *.npy *.bin", number_picture, 8 << 10, 6 * 1032 + 2, 128 * kMebibyte},
};

} // namespace pictures

std::span<const FuzzTarget> picture_targets()
{
    return pictures::kTargets;
}

} // namespace semrover::fuzz
