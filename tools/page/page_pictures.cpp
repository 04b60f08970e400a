// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/page/page.h"

#include "engine/format/flow_picture.h"
#include "engine/format/image.h"
#include "engine/shards/shard_set.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>

namespace semrover {

namespace {

using Files = std::map<uint32_t, Path>;

constexpr double kPngMayBe = 1.25; // times as large as a JPEG: edges of labels are worth that
constexpr size_t kFewColors = 64;
constexpr double kFlat = 0.65; // share of the pixels: drawn labels have 0.8, pictures and splats 0.25 to 0.5
constexpr double kSameShape = 0.01;
constexpr std::array<uint8_t, 3> kNothing = {50, 50, 50};
constexpr double kFullColor = 32; // pixels of flow

std::optional<uint32_t> number_of(const Path& file)
{
    const std::string extension = file.extension().string(), stem = file.stem().string();
    if (extension != ".png" && extension != ".jpg" && extension != ".jpeg")
        return std::nullopt;
    uint32_t number = 0;
    const auto [end, error] = std::from_chars(stem.data(), stem.data() + stem.size(), number);
    if (stem.empty() || stem.size() > 9 || error != std::errc() || end != stem.data() + stem.size())
        return std::nullopt;
    return number;
}

std::string advice(const Path& folder)
{
    for (const char* name : {"color", "frames"})
        if (is_folder(folder / name))
            return fmt::format("; there is {}", quote_path(folder / name));
    return "";
}

Result<Files> list_pictures(const PictureSet& set)
{
    Files files;
    const auto listed = list_files(set.folder);
    if (!listed)
        return fail(ErrorCode::bad_input, "expected a folder of pictures: {}", listed.error().message);
    for (const Path& file : *listed) {
        const auto number = number_of(file);
        if (!number)
            continue;
        const auto [other, added] = files.emplace(*number, file);
        if (!added)
            return fail(ErrorCode::bad_input, "{}: two pictures have the number {}: {} and {}", quote_path(set.folder),
                        *number, quote_path(other->second.filename()), quote_path(file.filename()));
    }
    if (files.empty())
        return fail(ErrorCode::bad_input, "{}: expected pictures named 000000.png, found none{}",
                    quote_path(set.folder), advice(set.folder));
    return files;
}

std::vector<uint32_t> shared_moments(const std::vector<Files>& sets)
{
    std::vector<uint32_t> shared;
    for (const auto& [number, file] : sets[0])
        if (std::ranges::all_of(sets, [&](const Files& files) { return files.contains(number); }))
            shared.push_back(number);
    return shared;
}

std::vector<uint32_t> spread(const std::vector<uint32_t>& all, size_t limit)
{
    if (all.size() <= limit)
        return all;
    std::vector<uint32_t> chosen;
    for (size_t i = 0; i < limit; ++i)
        chosen.push_back(all[limit == 1 ? 0 : i * (all.size() - 1) / (limit - 1)]);
    return chosen;
}

// drawn rather than seen: nearly all of it in a few colours, whose edges JPEG would smear
bool is_flat(const ImageRgb8& image)
{
    std::vector<uint32_t> colors, counts;
    for (size_t i = 0; i < image.pixels.size(); i += 3)
        colors.push_back(uint32_t(image.pixels[i]) << 16 | uint32_t(image.pixels[i + 1]) << 8 | image.pixels[i + 2]);
    std::ranges::sort(colors);
    for (size_t i = 0, begin = 0; i < colors.size(); ++i)
        if (i + 1 == colors.size() || colors[i + 1] != colors[i]) {
            counts.push_back(uint32_t(i + 1 - begin));
            begin = i + 1;
        }
    std::ranges::sort(counts, std::greater());
    uint64_t most = 0;
    for (size_t i = 0; i < std::min(counts.size(), kFewColors); ++i)
        most += counts[i];
    return double(most) >= kFlat * double(colors.size());
}

// hue: turns from red, at least 0
std::array<uint8_t, 3> color_of(double hue, double saturation, double light)
{
    std::array<uint8_t, 3> color{};
    for (size_t c = 0; c < 3; ++c) {
        const double away = std::abs(std::fmod(hue + double(3 - c) / 3, 1.0) * 6 - 3);
        color[c] = uint8_t(255 * light * (1 - saturation + saturation * std::clamp(away - 1, 0.0, 1.0)));
    }
    return color;
}

// neighbours in number are far apart in hue; nothing is dark
std::array<uint8_t, 3> instance_color(uint16_t number)
{
    return number ? color_of(0.618034 * number, 0.7, 0.6 + 0.4 * std::fmod(0.381966 * number, 1.0)) : kNothing;
}

// hue is the direction, saturation the length: what stands is white
std::array<uint8_t, 3> flow_color(float u, float v)
{
    if (!(u < 1e9f))
        return kNothing;
    const double turns = std::atan2(v, u) / (2 * std::numbers::pi);
    return color_of(turns + 1, std::sqrt(std::min(std::hypot(u, v) / kFullColor, 1.0)), 1);
}

// a picture as people see it: numbers of instances and flow have colours
Result<ImageRgb8> read_shown(const Path& file)
{
    ImageRgb8 image;
    const auto put = [&](const std::array<uint8_t, 3>& color) {
        image.pixels.insert(image.pixels.end(), color.begin(), color.end());
    };
    if (file.parent_path().filename() == "instance") {
        SR_TRY(const ImageGray16 numbers, read_png_gray16(file));
        std::tie(image.width, image.height) = std::pair(numbers.width, numbers.height);
        for (const uint16_t number : numbers.pixels)
            put(instance_color(number));
        return image;
    }
    if (file.parent_path().filename() != "flow")
        return read_image_rgb8(file);
    SR_TRY(const FlowPicture flow, read_flow_png(file));
    std::tie(image.width, image.height) = std::pair(flow.width, flow.height);
    for (size_t i = 0; i < flow.flow.size(); i += 2)
        put(flow_color(flow.flow[i], flow.flow[i + 1]));
    return image;
}

Result<Picture> encode(const ImageRgb8& image, int quality)
{
    SR_TRY(std::vector<std::byte> png, encode_png_rgb8(image.width, image.height, image.pixels));
    if (is_flat(image))
        return Picture{"image/png", std::move(png)};
    SR_TRY(std::vector<std::byte> jpeg, encode_jpeg_rgb8(image.width, image.height, image.pixels, quality));
    if (double(png.size()) <= kPngMayBe * double(jpeg.size()))
        return Picture{"image/png", std::move(png)};
    return Picture{"image/jpeg", std::move(jpeg)};
}

Status check_size(const PictureTable& t, const Path& file, const ImageRgb8& image, size_t set)
{
    const auto [width, height] = t.sizes[set];
    if (image.width != width || image.height != height)
        return fail(ErrorCode::bad_input, "{}: {} x {} pixels, but the first picture of {} has {} x {}",
                    quote_path(file), image.width, image.height, quote(t.names[set]), width, height);
    const auto [first_width, first_height] = t.sizes[0];
    const double shape = double(width) / height, first = double(first_width) / first_height;
    if (std::abs(shape - first) > kSameShape * first)
        return fail(ErrorCode::bad_input,
                    "{}: {} x {} pixels beside {} x {} of {}: the shapes differ, so the pictures "
                    "cannot lie on each other",
                    quote_path(file), width, height, first_width, first_height, quote(t.names[0]));
    return {};
}

Result<std::vector<Files>> list_sets(const std::vector<PictureSet>& sets, PictureTable& t)
{
    std::vector<Files> files;
    for (const PictureSet& set : sets) {
        t.names.push_back(printable(set.name));
        SR_TRY(files.emplace_back(), list_pictures(set));
    }
    const std::vector<uint32_t> shared = shared_moments(files);
    t.shared = shared.size();
    for (size_t s = 0; s < sets.size(); ++s)
        if (files[s].size() > shared.size())
            t.warnings.push_back(fmt::format("{} of {} pictures of {} are left out: other sets lack those moments",
                                             files[s].size() - shared.size(), files[s].size(), quote(sets[s].name)));
    if (shared.empty()) {
        std::string ranges;
        for (size_t s = 0; s < sets.size(); ++s)
            ranges += fmt::format("{}{} has {} to {}", s ? ", " : "", quote(sets[s].name), files[s].begin()->first,
                                  files[s].rbegin()->first);
        return fail(ErrorCode::bad_input, "no moment is in all sets of pictures: {}", ranges);
    }
    return files;
}

} // namespace

Result<PictureTable> read_pictures(const std::vector<PictureSet>& sets, const PictureOptions& options,
                                   const std::function<Status(uint64_t done, uint64_t total)>& done)
{
    SR_ASSERT(options.limit > 0, "no moments are asked for");
    PictureTable t;
    if (sets.empty())
        return t;
    std::vector<ShardsOrNone> shards; // that the pictures are in
    for (const PictureSet& set : sets) {
        SR_TRY(shards.emplace_back(), open_if_shards(set.folder));
    }
    SR_TRY(std::vector<Files> files, list_sets(sets, t));
    t.moments = spread(shared_moments(files), options.limit);
    uint64_t count = 0;
    for (size_t s = 0; s < sets.size(); ++s) {
        std::vector<Picture>& row = t.pictures.emplace_back();
        for (const uint32_t moment : t.moments) {
            const Path& file = files[s][moment];
            SR_TRY(const ImageRgb8 image, read_shown(file));
            if (row.empty())
                t.sizes.emplace_back(image.width, image.height);
            SR_CHECK(check_size(t, file, image, s));
            SR_TRY(row.emplace_back(), encode(image, options.quality));
            SR_CHECK(done(++count, uint64_t(sets.size()) * t.moments.size()));
        }
    }
    return t;
}

} // namespace semrover
