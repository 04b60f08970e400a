// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// KITTI's labels of objects and of tracks. Source: the readme files of the devkits for objects and for tracking,
// https://www.cvlibs.net/datasets/kitti
#include "runtime/base/quote.h"
#include "tools/dataset/object_boxes.h"
#include "tools/dataset/rigid_file.h"
#include "tools/trajectory/camera_text.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr SourceLabel kKittiLabels[] = {
    {0, "Car", 13},     {1, "Van", 13},  {2, "Truck", 14},      {3, "Pedestrian", 11},     {4, "Person_sitting", 11},
    {5, "Cyclist", 12}, {6, "Tram", 16}, {7, "Misc", kLeftOut}, {8, "DontCare", kLeftOut},
};

constexpr size_t kNumbers = 14; // after the type: truncated occluded alpha, 4 of the picture, h w l, x y z, rotation_y
constexpr size_t kMostWords = 18; // frame, track, type, the numbers, a score
constexpr uint64_t kMaxLabelBytes = 256u << 20;

// rectified camera axes (x right, y down, z forward) to x forward, y left, z up, at the same place
constexpr Rigid kCameraToForward = {0, 0, 1, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 0, 1};

struct KittiLabel {
    std::string_view type;
    double frame = 0, track = 0; // of tracking
    std::vector<double> numbers;
};

Result<KittiLabel> parse_label(std::string_view line, size_t prefix, std::string_view where)
{
    std::vector<std::string_view> words = words_of(line, kMostWords);
    if (words.size() != prefix + 1 + kNumbers && words.size() != prefix + 2 + kNumbers)
        return fail(ErrorCode::bad_input, "{}: expected {} words of a label, or one more with a score, found {}", where,
                    prefix + 1 + kNumbers, words.size() > kMostWords ? "more" : fmt::format("{}", words.size()));
    KittiLabel label;
    if (prefix) {
        SR_TRY(label.frame, number_of(words[0], fmt::format("{}: frame", where)));
        SR_TRY(label.track, number_of(words[1], fmt::format("{}: track id", where)));
    }
    label.type = words[prefix];
    words.erase(words.begin(), words.begin() + std::ptrdiff_t(prefix) + 1);
    SR_TRY(label.numbers, numbers_of_words(words, where));
    if (!std::ranges::all_of(label.numbers, [](double v) { return std::isfinite(v); }))
        return fail(ErrorCode::bad_input, "{}: a number that is not finite", where);
    return label;
}

// in the camera's axes. The place is the middle of the box's bottom; rotation_y turns about the axis
// that points down: a box with 0 looks along x, with pi / 2 along -z
Rigid pose_of(const KittiLabel& label)
{
    const double height = label.numbers[7], turn = label.numbers[13], c = std::cos(turn), s = std::sin(turn);
    const double* at = &label.numbers[10];
    return {c, s, 0, at[0], 0, 0, -1, at[1] - height / 2, -s, c, 0, at[2], 0, 0, 0, 1};
}

Status add_label(const KittiLabel& label, size_t prefix, const Rigid& to_frame, std::string_view where,
                 BoxCollector& to)
{
    ForeignBox box{.label = label.type, .pose = compose(to_frame, pose_of(label)), .size = {}};
    box.size = {label.numbers[9], label.numbers[8], label.numbers[7]};
    const bool left_out = label.type == "DontCare"; // its track is -1
    if (prefix && !left_out) {
        if (label.track < 0 || label.track > UINT32_MAX || label.track != std::floor(label.track))
            return fail(ErrorCode::bad_input, "{}: track id: expected a whole number, found {}", where, label.track);
        box.id = uint64_t(label.track);
    }
    return to.add(box, where);
}

} // namespace

std::span<const SourceLabel> kitti_box_labels()
{
    return kKittiLabels;
}

std::optional<size_t> kitti_label_prefix(std::string_view line)
{
    const std::vector<std::string_view> words = words_of(line, kMostWords);
    for (const size_t prefix : {0u, 2u}) {
        if (words.size() != prefix + 1 + kNumbers && words.size() != prefix + 2 + kNumbers)
            continue;
        bool fits = true;
        for (size_t i = 0; i < words.size(); ++i)
            fits = fits && number_of(words[i], "").has_value() == (i != prefix);
        if (fits)
            return prefix;
    }
    return std::nullopt;
}

Status read_kitti_boxes(const Path& path, const BoxOptions& options, BoxCollector& to)
{
    const std::string name = quote_path(path);
    Rigid to_frame = kCameraToForward;
    if (!options.calibration.empty()) {
        SR_TRY(to_frame, read_kitti_lidar(options.calibration));
        to_frame = inverse(to_frame);
    }
    SR_TRY(const std::string text, read_text_file(path, kMaxLabelBytes));
    std::optional<size_t> prefix;
    std::optional<double> frame;
    double last = -1;
    if (options.frame)
        frame = double(*options.frame);
    for (TextLines lines(text); lines.next();) {
        if (count_words(lines.line()) == 0)
            continue;
        const std::string where = fmt::format("{} line {}", name, lines.number());
        if (!prefix) // the first line shows which labels these are
            prefix = kitti_label_prefix(lines.line()).value_or(0);
        SR_TRY(const KittiLabel label, parse_label(lines.line(), *prefix, where));
        if (*prefix == 0 && options.frame)
            return fail(ErrorCode::usage, "{}: `frame` is for labels of tracking, these are of one frame", name);
        if (*prefix && !frame)
            frame = label.frame;
        last = std::max(last, label.frame);
        if (*prefix && label.frame != *frame) {
            if (options.frame)
                continue;
            return fail(ErrorCode::bad_input, "{}: frame {} after frame {}: choose one with `frame`", where,
                        label.frame, *frame);
        }
        SR_CHECK(add_label(label, *prefix, to_frame, where, to));
    }
    if (options.frame && last < *frame) // frames without objects have no line
        return fail(ErrorCode::bad_input, "{}: there is no frame {}, the last is {}", name, *frame, last);
    return {};
}

} // namespace semrover
