// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/fusion/depth_frames.h"

#include "engine/scene/srgb.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

struct Range {
    uint32_t first, end;
};

// old pixels whose centres new pixel i covers, or the one that its own centre lies in
std::vector<Range> covered(uint32_t from, uint32_t to)
{
    std::vector<Range> ranges;
    const auto centres_before = [&](uint64_t edge) { // of the old pixels, in front of a new pixel's edge
        return uint32_t((2 * edge * from + to - 1) / (2 * uint64_t(to)));
    };
    for (uint32_t i = 0; i < to; ++i) {
        Range r{centres_before(i), centres_before(i + 1)};
        if (r.first == r.end) {
            r.first = uint32_t((2 * uint64_t(i) + 1) * from / (2 * uint64_t(to)));
            r.end = r.first + 1;
        }
        ranges.push_back(r);
    }
    return ranges;
}

} // namespace

ImageRgb8 resampled(const ImageRgb8& image, ImageSize to)
{
    const std::vector<Range> columns = covered(image.width, to.width), rows = covered(image.height, to.height);
    ImageRgb8 out{to.width, to.height, {}};
    out.pixels.reserve(size_t(to.width) * to.height * 3);
    for (const Range& row : rows)
        for (const Range& column : columns) {
            std::array<double, 3> sum{};
            for (uint32_t y = row.first; y < row.end; ++y)
                for (uint32_t x = column.first; x < column.end; ++x)
                    for (size_t c = 0; c < 3; ++c)
                        sum[c] += kLinear[image.pixels[(size_t(y) * image.width + x) * 3 + c]];
            const double count = double(row.end - row.first) * (column.end - column.first);
            for (const double s : sum)
                out.pixels.push_back(uint8_t(std::lround(255 * srgb_of_linear(std::min(s / count, 1.0)))));
        }
    return out;
}

bool same_view(ImageSize a, ImageSize b)
{
    const double ratio = double(a.width) * b.height / (double(a.height) * b.width);
    return std::abs(ratio - 1) <= 0.02;
}

} // namespace semrover
