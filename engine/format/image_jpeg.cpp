// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/image.h"

#include "runtime/base/quote.h"

#include <algorithm>
#include <csetjmp>
#include <cstdio>
#include <cstdlib>
#include <jpeglib.h>

#include <jerror.h> // needs jpeglib.h

namespace semrover {

namespace {

constexpr uint64_t kMaxJpegBytes = 1u << 30;
// Pixels of a byte at most: each scan spends a bit or more on a block, and where one component is sampled 4 x 1 and
// another 1 x 4, eight blocks are 1024 pixels.
constexpr uint64_t kMaxExpansion = 1024;
constexpr int kMaxScans = 100; // of a progressive file; encoders make about ten. Each visits all blocks

// what libjpeg only warns of, and fills with gray
constexpr int kDamage[] = {JWRN_JPEG_EOF, JWRN_HIT_MARKER, JWRN_HUFF_BAD_CODE, JWRN_MUST_RESYNC};

// libjpeg reports errors by a callback that must not return: it keeps the message and jumps back. No object with a
// destructor lives in a frame that is jumped over.
struct Errors {
    jpeg_error_mgr manager; // first: libjpeg hands back its address
    std::jmp_buf jump;
    char message[JMSG_LENGTH_MAX] = "";

    jpeg_error_mgr* install()
    {
        jpeg_std_error(&manager);
        manager.error_exit = [](j_common_ptr info) {
            auto* self = reinterpret_cast<Errors*>(info->err);
            info->err->format_message(info, self->message);
            std::longjmp(self->jump, 1);
        };
        manager.emit_message = [](j_common_ptr info, int level) {
            if (level < 0 && std::ranges::find(kDamage, info->err->msg_code) != std::end(kDamage))
                info->err->error_exit(info);
        };
        manager.output_message = [](j_common_ptr) {}; // other warnings do not go to the terminal
        return &manager;
    }
};

struct Encoder {
    jpeg_compress_struct info{};
    Errors errors;
    unsigned char* bytes = nullptr; // malloc'ed by libjpeg
    unsigned long size = 0;

    Encoder() { info.err = errors.install(); }
    std::span<const std::byte> file() const { return std::as_bytes(std::span(bytes, size)); }
    Encoder(const Encoder&) = delete;
    Encoder& operator=(const Encoder&) = delete;
    ~Encoder()
    {
        jpeg_destroy_compress(&info);
        std::free(bytes);
    }
};

bool encode_rows(Encoder& e, uint32_t width, uint32_t height, const uint8_t* pixels, int quality)
{
    if (setjmp(e.errors.jump))
        return false;
    jpeg_create_compress(&e.info);
    jpeg_mem_dest(&e.info, &e.bytes, &e.size);
    e.info.image_width = width;
    e.info.image_height = height;
    e.info.input_components = 3;
    e.info.in_color_space = JCS_RGB;
    jpeg_set_defaults(&e.info);
    jpeg_set_quality(&e.info, quality, TRUE);
    e.info.dct_method = JDCT_ISLOW; // the same bytes on every CPU
    jpeg_start_compress(&e.info, TRUE);
    while (e.info.next_scanline < height) {
        auto* row = const_cast<uint8_t*>(pixels + size_t(e.info.next_scanline) * width * 3);
        jpeg_write_scanlines(&e.info, &row, 1);
    }
    jpeg_finish_compress(&e.info);
    return true;
}

Status encode(Encoder& e, uint32_t width, uint32_t height, std::span<const uint8_t> pixels, int quality)
{
    SR_ASSERT(pixels.size() == size_t(width) * height * 3 && quality >= 1 && quality <= 100,
              "{} x {} pixels given with {} bytes, quality {}", width, height, pixels.size(), quality);
    if (width == 0 || height == 0 || width > kMaxImageSide || height > kMaxImageSide)
        return fail(ErrorCode::bad_input, "cannot write a JPEG: an image of {} x {} pixels, expected 1 to {} each way",
                    width, height, kMaxImageSide);
    if (!encode_rows(e, width, height, pixels.data(), quality))
        return fail(ErrorCode::out_of_memory, "cannot write a JPEG: {}", printable(e.errors.message));
    return {};
}

struct Decoder {
    jpeg_decompress_struct info{};
    Errors errors;
    jpeg_progress_mgr progress{};

    Decoder() { info.err = errors.install(); }
    Decoder(const Decoder&) = delete;
    Decoder& operator=(const Decoder&) = delete;
    ~Decoder() { jpeg_destroy_decompress(&info); }
};

bool read_header(Decoder& d, std::span<const std::byte> file)
{
    if (setjmp(d.errors.jump))
        return false;
    jpeg_create_decompress(&d.info);
    jpeg_mem_src(&d.info, reinterpret_cast<const unsigned char*>(file.data()), static_cast<unsigned long>(file.size()));
    jpeg_read_header(&d.info, TRUE);
    return true;
}

Status open_jpeg(Decoder& d, std::span<const std::byte> file, std::string_view where)
{
    if (file.empty() || !read_header(d, file))
        return fail(ErrorCode::bad_input, "{}: not a valid JPEG: {}", where,
                    file.empty() ? "the file is empty" : printable(d.errors.message));
    return {};
}

void check_scans(j_common_ptr info)
{
    if (reinterpret_cast<j_decompress_ptr>(info)->input_scan_number <= kMaxScans)
        return;
    auto* errors = reinterpret_cast<Errors*>(info->err);
    std::snprintf(errors->message, sizeof(errors->message), "it has more than %d scans", kMaxScans);
    std::longjmp(errors->jump, 1);
}

// a progressive file whose end marker comes before the first scan of a component;
// jpeg_finish_decompress frees what shows it
bool lacks_scans(const Decoder& d)
{
    for (int c = 0; d.info.coef_bits && c < d.info.num_components; ++c)
        if (d.info.coef_bits[c][0] < 0)
            return true;
    return false;
}

// Photoshop's files say by their marker that they hold what is left of the light; others hold ink
void rgb_of_cmyk(const uint8_t* cmyk, uint8_t* rgb, uint32_t width, bool is_light)
{
    for (uint32_t x = 0; x < width; ++x)
        for (uint32_t c = 0; c < 3; ++c) {
            const uint32_t color = cmyk[4 * x + c], black = cmyk[4 * x + 3];
            const uint32_t product = is_light ? color * black : (255 - color) * (255 - black);
            rgb[3 * x + c] = uint8_t((product + 127) / 255);
        }
}

// rows are appended, so that a cut file takes no memory for those that it lacks; `pixels` has room for all
bool read_rows(Decoder& d, std::vector<uint8_t>& pixels)
{
    if (setjmp(d.errors.jump))
        return false;
    const bool cmyk = d.info.jpeg_color_space == JCS_CMYK || d.info.jpeg_color_space == JCS_YCCK;
    d.info.out_color_space = cmyk ? JCS_CMYK : JCS_RGB;
    d.info.dct_method = JDCT_ISLOW;
    d.progress.progress_monitor = check_scans;
    d.info.progress = &d.progress;
    jpeg_start_decompress(&d.info);
    const size_t row_bytes = size_t(d.info.output_width) * 3;
    JSAMPARRAY inks = nullptr; // libjpeg frees it
    if (cmyk)
        inks = (*d.info.mem->alloc_sarray)(reinterpret_cast<j_common_ptr>(&d.info), JPOOL_IMAGE,
                                           d.info.output_width * 4, 1);
    while (d.info.output_scanline < d.info.output_height) {
        const size_t begin = pixels.size();
        pixels.resize(begin + row_bytes);
        uint8_t* row = pixels.data() + begin;
        jpeg_read_scanlines(&d.info, cmyk ? inks : &row, 1);
        if (cmyk)
            rgb_of_cmyk(inks[0], row, d.info.output_width, d.info.saw_Adobe_marker);
    }
    if (lacks_scans(d)) {
        std::snprintf(d.errors.message, sizeof(d.errors.message), "it ends before all components were seen");
        return false;
    }
    jpeg_finish_decompress(&d.info);
    return true;
}

} // namespace

Result<std::vector<std::byte>> encode_jpeg_rgb8(uint32_t width, uint32_t height, std::span<const uint8_t> pixels,
                                                int quality)
{
    Encoder e;
    SR_CHECK(encode(e, width, height, pixels, quality));
    return std::vector<std::byte>(e.file().begin(), e.file().end());
}

Result<ImageRgb8> read_jpeg_rgb8(const Path& path)
{
    SR_TRY(const std::vector<std::byte> file, read_file(path, kMaxJpegBytes));
    return decode_jpeg_rgb8(file, quote_path(path));
}

Result<ImageSize> jpeg_size(std::span<const std::byte> file, std::string_view where)
{
    Decoder d;
    SR_CHECK(open_jpeg(d, file, where));
    return ImageSize{d.info.image_width, d.info.image_height};
}

Result<ImageRgb8> decode_jpeg_rgb8(std::span<const std::byte> file, std::string_view where, uint64_t max_pixels)
{
    Decoder d;
    SR_CHECK(open_jpeg(d, file, where));
    const uint64_t pixels = uint64_t(d.info.image_width) * d.info.image_height;
    if (d.info.image_width > kMaxImageSide || d.info.image_height > kMaxImageSide ||
        pixels / kMaxExpansion > file.size())
        return fail(ErrorCode::bad_input,
                    "{}: {} x {} pixels in {} bytes, at most {} to a side and {} to a byte; the file is cut or too "
                    "large",
                    where, d.info.image_width, d.info.image_height, file.size(), kMaxImageSide, kMaxExpansion);
    SR_CHECK(check_pixels({d.info.image_width, d.info.image_height}, max_pixels, where));
    if (d.info.arith_code)
        return fail(ErrorCode::bad_input, "{}: a JPEG with arithmetic coding, which is not supported", where);
    ImageRgb8 image{d.info.image_width, d.info.image_height, {}};
    image.pixels.reserve(pixels * 3);
    if (!read_rows(d, image.pixels))
        return fail(ErrorCode::bad_input, "{}: not a valid JPEG: {}", where, printable(d.errors.message));
    return image;
}

} // namespace semrover
