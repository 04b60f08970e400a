// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// BMP, TGA and HDR by stb_image. It takes a cut file for a whole one: past the end it reads zeros, leaves rows as they
// were allocated, and never ends on an HDR (CVE-2021-42715). So it works on a copy with bytes behind the file's, and
// one that read any of them is refused. Sizes and palettes are checked in front, for the same reason.
#include "engine/mesh/texture_image.h"

#include "engine/format/number_image.h"
#include "engine/scene/palette.h"
#include "engine/scene/srgb.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <memory>

#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_ONLY_BMP
#define STBI_ONLY_HDR
#define STBI_ONLY_TGA
#define STBI_NO_STDIO
#define STBI_NO_SIMD
#define STBI_MAX_DIMENSIONS int(semrover::kMaxImageSide)
#define STBI_FAILURE_USERMSG
#include <stb_image.h>

namespace semrover {

namespace {

constexpr uint64_t kMaxTextureBytes = 1u << 30;
// behind the file: more than a row, which stb_image reads whole or not at all. Runs of it end a broken row.
constexpr size_t kPadding = 4 * kMaxImageSide + 4096;
constexpr uint8_t kFiller = 0xff;

// what stb_image's formats have in common
struct StbFormat {
    const char* name;
    int (*info)(stbi__context*, int*, int*, int*);
    uint64_t max_expansion; // pixels of a byte
};

constexpr StbFormat kBmp{"BMP", stbi__bmp_info, 8};
constexpr StbFormat kTga{"TGA", stbi__tga_info, 64}; // a run of 128 gray pixels takes 2 bytes
constexpr StbFormat kHdr{"HDR", stbi__hdr_info, 16}; // runs of 127 in 4 channels take 8 bytes

struct StbFree {
    void operator()(void* pixels) const { stbi_image_free(pixels); }
};

class StbFile {
  public:
    StbFile(std::vector<std::byte> file, std::string where, uint64_t max_pixels)
        : bytes_(std::move(file)), size_(bytes_.size()), where_(std::move(where)), max_pixels_(max_pixels)
    {
        bytes_.resize(size_ + kPadding, std::byte(kFiller));
        rewind();
    }

    Result<ImageWithAlpha> bmp();
    Result<ImageWithAlpha> tga();
    Result<ImageWithAlpha> hdr();

  private:
    void rewind();
    Result<ImageSize> size_as(const StbFormat& format);
    Status check_bmp_palette(ImageSize size) const;
    Status check_end(const void* pixels, const StbFormat& format) const;
    int wanted_channels() const { return channels_ == 2 || channels_ == 4 ? 4 : 3; }
    Result<ImageWithAlpha> image_of(stbi_uc* pixels, ImageSize size, int channels, const StbFormat& format) const;
    uint32_t byte(size_t at) const { return uint32_t(bytes_[at]); }
    uint32_t word(size_t at) const { return byte(at) | byte(at + 1) << 8 | byte(at + 2) << 16 | byte(at + 3) << 24; }

    std::vector<std::byte> bytes_;
    size_t size_; // of the file
    std::string where_;
    uint64_t max_pixels_;
    stbi__context context_;
    int width_ = 0, height_ = 0, channels_ = 0; // as stb_image reports them
};

void StbFile::rewind()
{
    stbi__start_mem(&context_, reinterpret_cast<const stbi_uc*>(bytes_.data()), int(bytes_.size()));
    stbi__g_failure_reason = "its header is broken"; // not every refusal sets one
}

Result<ImageSize> StbFile::size_as(const StbFormat& format)
{
    if (!format.info(&context_, &width_, &height_, &channels_))
        return fail(ErrorCode::bad_input, "{}: not a valid {}: {}", where_, format.name, stbi_failure_reason());
    const int64_t width = width_, height = std::abs(int64_t(height_)); // a BMP's is negative where its top row is first
    if (width < 1 || height < 1 || width > kMaxImageSide || height > kMaxImageSide)
        return fail(ErrorCode::bad_input, "{}: an image of {} x {} pixels, expected 1 to {} each way", where_, width,
                    height, kMaxImageSide);
    if (uint64_t(width * height) / format.max_expansion > size_)
        return fail(ErrorCode::bad_input, "{}: {} x {} pixels cannot come from {} bytes; the file is cut", where_,
                    width, height, size_);
    rewind();
    const ImageSize size{uint32_t(width), uint32_t(height)};
    SR_CHECK(check_pixels(size, max_pixels_, where_));
    return size;
}

Status StbFile::check_end(const void* pixels, const StbFormat& format) const
{
    if (size_t(context_.img_buffer - context_.img_buffer_original) > size_)
        return fail(ErrorCode::bad_input, "{}: not a valid {}: the file is cut", where_, format.name);
    if (!pixels)
        return fail(ErrorCode::bad_input, "{}: not a valid {}: {}", where_, format.name, stbi_failure_reason());
    return {};
}

Result<ImageWithAlpha> StbFile::image_of(stbi_uc* pixels, ImageSize size, int channels, const StbFormat& format) const
{
    const std::unique_ptr<stbi_uc, StbFree> owner(pixels);
    SR_CHECK(check_end(pixels, format));
    std::vector<uint8_t> values(pixels, pixels + size_t(size.width) * size.height * size_t(channels));
    if (channels == 4)
        return split_alpha(size, std::move(values));
    return ImageWithAlpha{{size.width, size.height, std::move(values)}, {}};
}

// stb_image looks pixels up beyond the palette. Its palette is what lies in front of the pixels.
Status StbFile::check_bmp_palette(ImageSize size) const
{
    const uint32_t offset = word(10), header = word(14), bits = (header == 12 ? word(24) : word(28)) & 0xffff;
    if (bits >= 16)
        return {};
    if (bits != 1 && bits != 4 && bits != 8)
        return fail(ErrorCode::bad_input, "{}: not a valid BMP: {} bits a pixel", where_, bits);
    const int64_t colours = header == 12 ? (int64_t(offset) - 38) / 3 : (int64_t(offset) - 14 - header) / 4;
    const uint64_t row = (uint64_t(size.width) * bits + 31) / 32 * 4;
    if (offset > size_ || row * size.height > size_ - offset)
        return fail(ErrorCode::bad_input, "{}: not a valid BMP: the file is cut", where_);
    for (uint32_t y = 0; y < size.height; ++y)
        for (uint32_t x = 0; x < size.width; ++x) {
            const uint32_t bit = x * bits;
            const uint32_t index = byte(offset + y * row + bit / 8) >> (8 - bits - bit % 8) & ((1u << bits) - 1);
            if (int64_t(index) >= colours)
                return fail(ErrorCode::bad_input, "{}: a pixel has colour {} of a palette of {}", where_, index,
                            colours);
        }
    return {};
}

Result<ImageWithAlpha> StbFile::bmp()
{
    SR_TRY(const ImageSize size, size_as(kBmp));
    SR_CHECK(check_bmp_palette(size));
    const int channels = wanted_channels();
    stbi__result_info info{};
    auto* pixels = static_cast<stbi_uc*>(stbi__bmp_load(&context_, &width_, &height_, &channels_, channels, &info));
    return image_of(pixels, size, channels, kBmp);
}

Result<ImageWithAlpha> StbFile::tga()
{
    SR_TRY(const ImageSize size, size_as(kTga));
    // stb_image would mirror the one, and skip bytes for the other's entries
    if (byte(17) & 0x10)
        return fail(ErrorCode::bad_input, "{}: a TGA with rows from right to left, which is not supported", where_);
    if (byte(1) && (byte(3) | byte(4)))
        return fail(ErrorCode::bad_input, "{}: a TGA whose palette begins at {}, expected 0", where_,
                    byte(3) | byte(4) << 8);
    const int channels = wanted_channels();
    stbi__result_info info{};
    auto* pixels = static_cast<stbi_uc*>(stbi__tga_load(&context_, &width_, &height_, &channels_, channels, &info));
    return image_of(pixels, size, channels, kTga);
}

// the nearest sRGB value of linear light: as many thresholds are not above it
uint8_t srgb8_of_linear(float value)
{
    static const std::array<float, 255> kThresholds = [] {
        std::array<float, 255> table{};
        for (size_t i = 0; i < table.size(); ++i)
            table[i] = float(linear_of_srgb((double(i) + 0.5) / 255));
        return table;
    }();
    return uint8_t(std::ranges::upper_bound(kThresholds, value) - kThresholds.begin());
}

Result<ImageWithAlpha> StbFile::hdr()
{
    SR_TRY(const ImageSize size, size_as(kHdr));
    stbi__result_info info{};
    const std::unique_ptr<float, StbFree> pixels(stbi__hdr_load(&context_, &width_, &height_, &channels_, 3, &info));
    SR_CHECK(check_end(pixels.get(), kHdr));
    ImageRgb8 image{size.width, size.height, {}};
    image.pixels.resize(size_t(size.width) * size.height * 3);
    std::transform(pixels.get(), pixels.get() + image.pixels.size(), image.pixels.begin(), srgb8_of_linear);
    return ImageWithAlpha{std::move(image), {}};
}

bool is_named_tga(const Path& path)
{
    std::string extension = path.extension().string();
    std::ranges::transform(extension, extension.begin(),
                           [](char c) { return c >= 'A' && c <= 'Z' ? char(c + 32) : c; });
    return extension == ".tga";
}

Result<ImageWithAlpha> decode(std::vector<std::byte> file, const std::string& where, bool named_tga,
                              TextureBudget& budget)
{
    const uint64_t max_pixels = budget.pixels_left(file.size());
    const std::string_view text(reinterpret_cast<const char*>(file.data()), file.size());
    if (text.starts_with("\x89PNG") || text.starts_with("\xff\xd8\xff"))
        return decode_image_with_alpha(file, where, max_pixels);
    if (text.starts_with("BM"))
        return StbFile(std::move(file), where, max_pixels).bmp();
    if (text.starts_with("#?RADIANCE\n") || text.starts_with("#?RGBE\n"))
        return StbFile(std::move(file), where, max_pixels).hdr();
    if (named_tga)
        return StbFile(std::move(file), where, max_pixels).tga();
    return fail(ErrorCode::bad_input, "{}: expected a PNG, JPEG, BMP, HDR or TGA image, found something else", where);
}

// whether the colours that a picture uses are all classes', or white
bool in_class_colors(const PngNumbers& image)
{
    std::array<bool, 256> used{};
    for (const uint16_t index : image.values)
        used[index & 255] = true;
    const auto known = [](const std::array<uint8_t, 3>& color) {
        return color == std::array<uint8_t, 3>{255, 255, 255} ||
               std::ranges::find(kPalette, color, &SemanticClass::color) != kPalette.end();
    };
    for (size_t i = 0; i < used.size(); ++i)
        if (used[i] && !(i < image.palette.size() && known(image.palette[i])))
            return false;
    return true;
}

} // namespace

Result<std::vector<uint16_t>> texture_numbers(std::span<const std::byte> file, std::string_view where)
{
    if (file.size() < 4 || std::memcmp(file.data(), "\x89PNG", 4) != 0)
        return std::vector<uint16_t>();
    SR_TRY(const PngInfo info, png_info(file, where));
    if (info.kind == PngKind::rgb || info.kind == PngKind::rgba || (info.kind == PngKind::gray && info.bits == 8))
        return std::vector<uint16_t>();
    SR_TRY(PngNumbers image, decode_png_numbers(file, where));
    if (info.kind == PngKind::palette && in_class_colors(image))
        return std::vector<uint16_t>();
    return label_numbers(std::move(image));
}

Result<ImageWithAlpha> read_texture(const Path& path, TextureBudget& budget)
{
    const std::string where = quote_path(path);
    SR_TRY(std::vector<std::byte> file, read_file(path, kMaxTextureBytes));
    SR_TRY(ImageWithAlpha image, decode(std::move(file), where, is_named_tga(path), budget));
    budget.take(image.color);
    return image;
}

} // namespace semrover
