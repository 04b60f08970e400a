// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/image.h"

#include "runtime/base/quote.h"

#include <bit>
#include <csetjmp>
#include <cstring>
#include <new>
#include <png.h>

namespace semrover {

namespace {

static_assert(std::endian::native == std::endian::little, "16-bit rows are swapped to PNG's big endian");

constexpr uint64_t kMaxPngBytes = 1u << 30;
constexpr uint64_t kMaxInflation = 1032; // deflate: 258 bytes from 2 bits at best

struct Format {
    int color_type;
    int bit_depth; // 8 or 16
    uint32_t channels;
    bool stored = false; // samples as they are in the file, those of fewer bits as 8

    size_t row_bytes(uint32_t width) const { return size_t(width) * channels * static_cast<size_t>(bit_depth / 8); }
};

constexpr Format kRgb8{PNG_COLOR_TYPE_RGB, 8, 3};
constexpr Format kRgba8{PNG_COLOR_TYPE_RGBA, 8, 4};
constexpr Format kGray8{PNG_COLOR_TYPE_GRAY, 8, 1};
constexpr Format kGray16{PNG_COLOR_TYPE_GRAY, 16, 1};
constexpr Format kRgb16{PNG_COLOR_TYPE_RGB, 16, 3};

// libpng reports errors by a callback that must not return: it keeps the message and jumps back into `run`. No object
// with a destructor lives in a frame that is jumped over.
struct Png {
    png_structp png = nullptr;
    png_infop info = nullptr;
    bool writing = false;
    char message[200] = "libpng: out of memory";

    std::vector<std::byte> output;    // writing
    std::span<const std::byte> input; // reading: what is left
    uint8_t* pixels = nullptr;        // reading: where rows go

    Png() = default;
    Png(const Png&) = delete;
    Png& operator=(const Png&) = delete;
    ~Png()
    {
        if (writing)
            png_destroy_write_struct(&png, &info);
        else
            png_destroy_read_struct(&png, &info, nullptr);
    }
};

void on_error(png_structp png, png_const_charp text)
{
    auto* self = static_cast<Png*>(png_get_error_ptr(png));
    std::strncpy(self->message, text, sizeof(self->message) - 1);
    png_longjmp(png, 1);
}

void on_warning(png_structp, png_const_charp) {} // of ancillary chunks, which are not used

void on_write(png_structp png, png_bytep data, size_t size)
{
    auto* self = static_cast<Png*>(png_get_io_ptr(png));
    bool full = false;
    try {
        const auto* bytes = reinterpret_cast<const std::byte*>(data);
        self->output.insert(self->output.end(), bytes, bytes + size);
    } catch (const std::bad_alloc&) {
        full = true; // the jump must not leave a handler
    }
    if (full)
        png_error(png, "out of memory");
}

void on_flush(png_structp) {}

void on_read(png_structp png, png_bytep data, size_t size)
{
    auto* self = static_cast<Png*>(png_get_io_ptr(png));
    if (size > self->input.size())
        png_error(png, "the file is cut");
    std::memcpy(data, self->input.data(), size);
    self->input = self->input.subspan(size);
}

bool encode(Png& p, const Format& format, uint32_t width, uint32_t height, const uint8_t* pixels, int level)
{
    p.writing = true;
    p.png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &p, on_error, on_warning);
    p.info = p.png ? png_create_info_struct(p.png) : nullptr;
    if (!p.info)
        return false;
    const size_t row_bytes = format.row_bytes(width);
    if (setjmp(png_jmpbuf(p.png)))
        return false;
    png_set_write_fn(p.png, &p, on_write, on_flush);
    png_set_user_limits(p.png, kMaxImageSide, kMaxImageSide);
    png_set_compression_level(p.png, level);
    png_set_IHDR(p.png, p.info, width, height, format.bit_depth, format.color_type, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(p.png, p.info);
    if (format.bit_depth == 16)
        png_set_swap(p.png);
    for (uint32_t y = 0; y < height; ++y)
        png_write_row(p.png, pixels + y * row_bytes);
    png_write_end(p.png, p.info);
    return true;
}

// the bytes of a PNG file
Result<std::vector<std::byte>> encode_png(std::string_view where, const Format& format, uint32_t width, uint32_t height,
                                          std::span<const std::byte> pixels, int level = kPngLevel)
{
    if (width == 0 || height == 0 || width > kMaxImageSide || height > kMaxImageSide)
        return fail(ErrorCode::bad_input, "cannot write {}: an image of {} x {} pixels, expected 1 to {} each way",
                    where, width, height, kMaxImageSide);
    SR_ASSERT(pixels.size() == format.row_bytes(width) * height, "{} x {} pixels given with {} bytes", width, height,
              pixels.size());
    Png p;
    if (!encode(p, format, width, height, reinterpret_cast<const uint8_t*>(pixels.data()), level))
        return fail(ErrorCode::out_of_memory, "cannot write {}: {}", where, p.message);
    return std::move(p.output);
}

Status write_png(const Path& path, const Format& format, uint32_t width, uint32_t height,
                 std::span<const std::byte> pixels)
{
    SR_TRY(const std::vector<std::byte> file, encode_png(quote_path(path), format, width, height, pixels));
    return write_file_atomically(path, file);
}

bool read_header(Png& p)
{
    p.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &p, on_error, on_warning);
    p.info = p.png ? png_create_info_struct(p.png) : nullptr;
    if (!p.info)
        return false;
    if (setjmp(png_jmpbuf(p.png)))
        return false;
    png_set_read_fn(p.png, &p, on_read);
    png_set_user_limits(p.png, kMaxImageSide, kMaxImageSide);
    png_set_chunk_malloc_max(p.png, 8u << 20);
    png_set_chunk_cache_max(p.png, 64);
    png_read_info(p.png, p.info);
    return true;
}

void convert_to(png_structp png, const Format& format)
{
    if (format.bit_depth == 16)
        png_set_swap(png);
    if (format.stored)
        png_set_packing(png);
    if (format.bit_depth == 16 || format.stored)
        return;
    png_set_scale_16(png);
    png_set_expand(png); // palettes, 1 to 4 bits, transparency
    png_set_gray_to_rgb(png);
    if (format.channels == 4)
        png_set_add_alpha(png, 0xff, PNG_FILLER_AFTER);
    else
        png_set_strip_alpha(png);
}

// false also when the file's kind does not come out as `format`
bool read_rows(Png& p, const Format& format, uint32_t width, uint32_t height)
{
    const size_t row_bytes = format.row_bytes(width);
    if (setjmp(png_jmpbuf(p.png)))
        return false;
    const int passes = png_set_interlace_handling(p.png);
    convert_to(p.png, format);
    png_read_update_info(p.png, p.info);
    if (png_get_rowbytes(p.png, p.info) != row_bytes)
        png_error(p.png, "rows of another kind than expected");
    for (int pass = 0; pass < passes; ++pass)
        for (uint32_t y = 0; y < height; ++y)
            png_read_row(p.png, p.pixels + y * row_bytes, nullptr);
    png_read_end(p.png, nullptr);
    return true;
}

Status check_signature(std::span<const std::byte> file, std::string_view where)
{
    if (file.size() < 8 || png_sig_cmp(reinterpret_cast<png_const_bytep>(file.data()), 0, 8) != 0)
        return fail(ErrorCode::bad_input, "{}: expected a PNG file, found something else", where);
    return {};
}

Result<PngInfo> open_png(Png& p, std::span<const std::byte> file, std::string_view where)
{
    SR_CHECK(check_signature(file, where));
    p.input = file;
    if (!read_header(p))
        return fail(ErrorCode::bad_input, "{}: not a valid PNG: {}", where, printable(p.message));
    const int type = png_get_color_type(p.png, p.info);
    const PngKind kind = type == PNG_COLOR_TYPE_GRAY         ? PngKind::gray
                         : type == PNG_COLOR_TYPE_GRAY_ALPHA ? PngKind::gray_alpha
                         : type == PNG_COLOR_TYPE_PALETTE    ? PngKind::palette
                         : type == PNG_COLOR_TYPE_RGB        ? PngKind::rgb
                                                             : PngKind::rgba;
    return PngInfo{{png_get_image_width(p.png, p.info), png_get_image_height(p.png, p.info)},
                   kind,
                   png_get_bit_depth(p.png, p.info)};
}

// the pixels go where `allocate(width, height)` says
template <typename Allocate>
Status decode_rows(Png& p, const PngInfo& info, std::span<const std::byte> file, std::string_view where,
                   const Format& format, uint64_t max_pixels, Allocate&& allocate)
{
    const auto [width, height] = info.size;
    const uint64_t stored = uint64_t(png_get_rowbytes(p.png, p.info)) * height;
    if (stored / kMaxInflation > file.size())
        return fail(ErrorCode::bad_input, "{}: {} x {} pixels cannot come from {} bytes; the file is cut", where, width,
                    height, file.size());
    SR_CHECK(check_pixels(info.size, max_pixels, where));
    p.pixels = allocate(width, height);
    if (!read_rows(p, format, width, height))
        return fail(ErrorCode::bad_input, "{}: not a valid PNG: {}", where, printable(p.message));
    return {};
}

template <typename Allocate>
Status decode_png(std::span<const std::byte> file, std::string_view where, const Format& format, uint64_t max_pixels,
                  Allocate&& allocate)
{
    Png p;
    SR_TRY(const PngInfo info, open_png(p, file, where));
    const bool gray = format.channels == 1;
    if (format.bit_depth == 16 && (info.bits != 16 || info.kind != (gray ? PngKind::gray : PngKind::rgb)))
        return fail(ErrorCode::bad_input, "{}: expected a PNG of 16-bit {}, found another kind", where,
                    gray ? "gray" : "RGB");
    return decode_rows(p, info, file, where, format, max_pixels, std::forward<Allocate>(allocate));
}

template <typename Allocate>
Status read_png(const Path& path, const Format& format, Allocate&& allocate)
{
    SR_TRY(const std::vector<std::byte> file, read_file(path, kMaxPngBytes));
    return decode_png(file, quote_path(path), format, kMaxImagePixels, std::forward<Allocate>(allocate));
}

Result<ImageRgb8> decode_png_rgb8(std::span<const std::byte> file, std::string_view where, uint64_t max_pixels)
{
    ImageRgb8 image;
    SR_CHECK(decode_png(file, where, kRgb8, max_pixels, [&](uint32_t width, uint32_t height) {
        image.width = width;
        image.height = height;
        image.pixels.resize(kRgb8.row_bytes(width) * height);
        return image.pixels.data();
    }));
    return image;
}

void take_numbers(const std::vector<uint8_t>& rows, const Format& format, PngNumbers& image)
{
    const bool wide = format.bit_depth == 16, alpha = format.channels % 2 == 0;
    const auto sample = [&](size_t i) { return uint16_t(wide ? rows[2 * i] | rows[2 * i + 1] << 8 : rows[i]); };
    const size_t pixels = size_t(image.info.size.width) * image.info.size.height;
    image.values.reserve(pixels);
    for (size_t i = 0; i < pixels; ++i) {
        const size_t at = i * format.channels;
        image.values.push_back(sample(at));
        if (alpha)
            image.transparent.push_back(sample(at + format.channels - 1) == 0);
        if (format.channels < 3 || image.color || (alpha && image.transparent[i]))
            continue;
        const std::array<uint16_t, 3> rgb = {sample(at), sample(at + 1), sample(at + 2)};
        if (rgb[0] != rgb[1] || rgb[0] != rgb[2])
            image.color = {i, rgb};
    }
}

bool starts_with(std::span<const std::byte> file, std::initializer_list<uint8_t> magic)
{
    return file.size() >= magic.size() && std::memcmp(file.data(), magic.begin(), magic.size()) == 0;
}

// whether a PNG can have transparent pixels: by its colour type, or a tRNS chunk in front of the pixels
bool may_have_alpha(std::span<const std::byte> file)
{
    if (file.size() < 26 || std::memcmp(file.data(), "\x89PNG", 4) != 0)
        return false;
    if ((uint32_t(file[25]) & PNG_COLOR_MASK_ALPHA) != 0)
        return true;
    for (size_t at = 8; at + 12 <= file.size();) {
        uint32_t length = 0;
        for (size_t i = 0; i < 4; ++i)
            length = length << 8 | uint32_t(file[at + i]);
        const char* type = reinterpret_cast<const char*>(file.data()) + at + 4;
        if (std::memcmp(type, "IDAT", 4) == 0)
            return false;
        if (std::memcmp(type, "tRNS", 4) == 0)
            return true;
        at += size_t(length) + 12;
    }
    return false;
}

} // namespace

Status write_png_rgb8(const Path& path, uint32_t width, uint32_t height, std::span<const uint8_t> pixels)
{
    return write_png(path, kRgb8, width, height, std::as_bytes(pixels));
}

Status write_png_gray8(const Path& path, uint32_t width, uint32_t height, std::span<const uint8_t> pixels)
{
    return write_png(path, kGray8, width, height, std::as_bytes(pixels));
}

Status write_png_gray16(const Path& path, uint32_t width, uint32_t height, std::span<const uint16_t> pixels)
{
    return write_png(path, kGray16, width, height, std::as_bytes(pixels));
}

Result<ImageRgb8> read_png_rgb8(const Path& path)
{
    SR_TRY(const std::vector<std::byte> file, read_file(path, kMaxPngBytes));
    return decode_png_rgb8(file, quote_path(path), kMaxImagePixels);
}

Result<std::vector<std::byte>> encode_png_rgb8(uint32_t width, uint32_t height, std::span<const uint8_t> pixels,
                                               int level)
{
    return encode_png("a PNG", kRgb8, width, height, std::as_bytes(pixels), level);
}

Result<std::vector<std::byte>> encode_png_gray8(uint32_t width, uint32_t height, std::span<const uint8_t> pixels,
                                                int level)
{
    return encode_png("a PNG", kGray8, width, height, std::as_bytes(pixels), level);
}

Result<std::vector<std::byte>> encode_png_gray16(uint32_t width, uint32_t height, std::span<const uint16_t> pixels,
                                                 int level)
{
    return encode_png("a PNG", kGray16, width, height, std::as_bytes(pixels), level);
}

Result<std::vector<std::byte>> encode_png_rgb16(uint32_t width, uint32_t height, std::span<const uint16_t> pixels,
                                                int level)
{
    return encode_png("a PNG", kRgb16, width, height, std::as_bytes(pixels), level);
}

Status check_pixels(ImageSize size, uint64_t max_pixels, std::string_view where)
{
    if (uint64_t(size.width) * size.height > max_pixels)
        return fail(ErrorCode::bad_input, "{}: {} x {} pixels, expected at most {} in all", where, size.width,
                    size.height, max_pixels);
    return {};
}

Result<ImageRgb8> decode_image_rgb8(std::span<const std::byte> file, std::string_view where, uint64_t max_pixels)
{
    if (starts_with(file, {0x89, 'P', 'N', 'G'}))
        return decode_png_rgb8(file, where, max_pixels);
    if (starts_with(file, {0xff, 0xd8, 0xff}))
        return decode_jpeg_rgb8(file, where, max_pixels);
    return fail(ErrorCode::bad_input, "{}: expected a PNG or JPEG image, found something else", where);
}

// in place: no more memory than the file's own pixels and their alpha
ImageWithAlpha split_alpha(ImageSize size, std::vector<uint8_t> rgba)
{
    ImageWithAlpha out{{size.width, size.height, std::move(rgba)}, {}};
    std::vector<uint8_t>& pixels = out.color.pixels;
    out.alpha.resize(pixels.size() / 4);
    bool opaque = true;
    for (size_t i = 0; i < out.alpha.size(); ++i) {
        out.alpha[i] = pixels[4 * i + 3];
        opaque = opaque && out.alpha[i] == 255;
        std::memmove(&pixels[3 * i], &pixels[4 * i], 3);
    }
    pixels.resize(3 * out.alpha.size());
    if (opaque)
        out.alpha = {};
    return out;
}

Result<ImageWithAlpha> decode_image_with_alpha(std::span<const std::byte> file, std::string_view where,
                                               uint64_t max_pixels)
{
    if (!may_have_alpha(file)) {
        SR_TRY(ImageRgb8 image, decode_image_rgb8(file, where, max_pixels));
        return ImageWithAlpha{std::move(image), {}};
    }
    ImageSize size;
    std::vector<uint8_t> rgba;
    SR_CHECK(decode_png(file, where, kRgba8, max_pixels, [&](uint32_t width, uint32_t height) {
        size = {width, height};
        rgba.resize(kRgba8.row_bytes(width) * height);
        return rgba.data();
    }));
    return split_alpha(size, std::move(rgba));
}

Result<ImageRgb8> read_image_rgb8(const Path& path)
{
    SR_TRY(const std::vector<std::byte> file, read_file(path, kMaxPngBytes));
    return decode_image_rgb8(file, quote_path(path));
}

Result<ImageSize> read_image_size(const Path& path)
{
    SR_TRY(const MappedFile file, MappedFile::open(path));
    const std::string where = quote_path(path);
    if (starts_with(file.bytes(), {0xff, 0xd8, 0xff}))
        return jpeg_size(file.bytes(), where);
    return png_info(file.bytes(), where).map([](const PngInfo& info) { return info.size; });
}

Result<PngInfo> png_info(std::span<const std::byte> file, std::string_view where)
{
    Png p;
    return open_png(p, file, where);
}

Result<PngNumbers> decode_png_numbers(std::span<const std::byte> file, std::string_view where, uint64_t max_pixels)
{
    Png p;
    PngNumbers image;
    SR_TRY(image.info, open_png(p, file, where));
    const Format format{0, image.info.bits == 16 ? 16 : 8, png_get_channels(p.png, p.info), true};
    std::vector<uint8_t> rows;
    SR_CHECK(decode_rows(p, image.info, file, where, format, max_pixels, [&](uint32_t width, uint32_t height) {
        rows.resize(format.row_bytes(width) * height);
        return rows.data();
    }));
    take_numbers(rows, format, image);
    png_colorp colors = nullptr;
    int count = 0;
    if (image.info.kind == PngKind::palette && png_get_PLTE(p.png, p.info, &colors, &count))
        for (int i = 0; i < count; ++i)
            image.palette.push_back({colors[i].red, colors[i].green, colors[i].blue});
    return image;
}

namespace {

template <typename Image>
Result<Image> read_png_16(const Path& path, const Format& format)
{
    Image image;
    SR_CHECK(read_png(path, format, [&](uint32_t width, uint32_t height) {
        image.width = width;
        image.height = height;
        image.pixels.resize(size_t(width) * height * format.channels);
        return reinterpret_cast<uint8_t*>(image.pixels.data());
    }));
    return image;
}

} // namespace

Result<ImageGray16> read_png_gray16(const Path& path)
{
    return read_png_16<ImageGray16>(path, kGray16);
}

Result<ImageRgb16> read_png_rgb16(const Path& path)
{
    return read_png_16<ImageRgb16>(path, kRgb16);
}

} // namespace semrover
