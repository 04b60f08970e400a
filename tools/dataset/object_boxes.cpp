// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/object_boxes.h"

#include "runtime/base/quote.h"
#include "runtime/base/text_start.h"
#include "tools/trajectory/camera_text.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace semrover {

namespace {

constexpr uint32_t kFirstFreeNumber = 1000; // above those of the tables
constexpr double kLeastUp = std::numbers::sqrt2 / 2;

struct BoxReader {
    BoxFormat format;
    std::string_view name;
    std::span<const SourceLabel> (*labels)();
    Status (*read)(const Path&, const BoxOptions&, BoxCollector&);
};

constexpr BoxReader kReaders[] = {
    {BoxFormat::kitti, "kitti-boxes", kitti_box_labels, read_kitti_boxes},
    {BoxFormat::nuscenes, "nuscenes-boxes", nuscenes_box_labels, read_nuscenes_boxes},
    {BoxFormat::waymo, "waymo-boxes", waymo_box_labels, read_waymo_boxes},
    {BoxFormat::carla, "carla-boxes", carla_box_labels, read_carla_boxes},
};

std::string beginning_of(const Path& path)
{
    return beginning_of_text(path, 64 << 10);
}

// the first line that has words is a label
bool starts_with_a_kitti_label(std::string_view text)
{
    for (TextLines lines(text); lines.next();)
        if (count_words(lines.line()))
            return kitti_label_prefix(lines.line()).has_value();
    return false;
}

Status check_options(BoxFormat format, const BoxOptions& o)
{
    const std::tuple<bool, const char*, bool> uses[] = {
        {!o.calibration.empty(), "calibration", format == BoxFormat::kitti},
        {o.frame.has_value(), "frame", format == BoxFormat::kitti || format == BoxFormat::waymo},
        {!o.sample.empty(), "sample", format == BoxFormat::nuscenes},
        {o.vehicle_frame, "vehicle_frame", format == BoxFormat::nuscenes || format == BoxFormat::waymo}};
    for (const auto& [given, name, has_place] : uses)
        if (given && !has_place)
            return fail(ErrorCode::usage, "`{}` has no meaning for {}", name, name_of(format));
    return {};
}

} // namespace

Result<BoxCollector> BoxCollector::create(std::span<const SourceLabel> table, const Path& map, const Point3& origin)
{
    BoxCollector collector;
    collector.origin_ = origin;
    collector.labels_ = LabelMap(table);
    for (const SourceLabel& label : table)
        collector.numbers_.emplace(label.name, label.number);
    if (map.empty())
        return collector;
    SR_TRY(LabelTable overrides, read_label_table(map));
    overrides.whole = false;
    for (LabelTable::Label& label : overrides.labels)
        if (!label.name.empty()) { // boxes have names: numbers of a table of other files mean nothing here
            label.number.reset();
            collector.number_of(label.name);
        }
    SR_CHECK(collector.labels_.apply(overrides));
    return collector;
}

uint32_t BoxCollector::number_of(std::string_view label)
{
    const auto known = numbers_.find(label);
    if (known != numbers_.end())
        return known->second;
    const uint32_t number = kFirstFreeNumber + uint32_t(numbers_.size());
    numbers_.emplace(label, number);
    labels_.set(number, std::string(label), std::nullopt);
    return number;
}

Status BoxCollector::add(const ForeignBox& box, std::string_view where)
{
    const uint8_t label = labels_(number_of(box.label));
    if (label >= kClassCount)
        return {};
    if (box.pose[10] < kLeastUp) {
        ++tilted_;
        return {};
    }
    if (objects_.size() == kMaxObjects)
        return fail(ErrorCode::bad_input, "{}: expected at most {} objects, found more", where, kMaxObjects);
    SceneObject o{.id = uint32_t(objects_.size()), .label = label, .size = box.size, .tint = box.tint};
    for (size_t a = 0; a < 3; ++a)
        o.center[a] = box.pose[a * 4 + 3] + origin_[a];
    o.heading = std::atan2(box.pose[4], box.pose[0]);
    SR_CHECK(check_object(o, where));
    if (box.id && *box.id <= UINT32_MAX) {
        o.id = uint32_t(*box.id);
        if (!ids_.insert(*box.id).second && repeated_.empty())
            repeated_ = fmt::format("{}: id {} is given twice", where, *box.id);
    } else {
        all_have_ids_ = false;
    }
    objects_.push_back(std::move(o));
    return {};
}

Result<std::vector<SceneObject>> BoxCollector::finish(std::string_view where)
{
    SR_CHECK(labels_.check(where, "objects"));
    if (all_have_ids_ && !repeated_.empty())
        return fail(ErrorCode::bad_input, "{}", repeated_);
    if (!all_have_ids_)
        for (size_t i = 0; i < objects_.size(); ++i)
            objects_[i].id = uint32_t(i);
    return std::move(objects_);
}

std::vector<std::string> BoxCollector::warnings() const
{
    std::vector<std::string> lines = labels_.left_out("objects");
    if (tilted_)
        lines.push_back(fmt::format("{} objects that are tilted by more than 45 degrees are left out", tilted_));
    return lines;
}

std::string_view name_of(BoxFormat format)
{
    return kReaders[size_t(format)].name;
}

std::optional<BoxFormat> box_format_of(std::string_view name)
{
    for (const BoxReader& reader : kReaders)
        if (reader.name == name)
            return reader.format;
    return std::nullopt;
}

std::string names_of_box_formats()
{
    std::string names;
    for (const BoxReader& reader : kReaders)
        names += fmt::format("{}{}", names.empty() ? "" : ", ", reader.name);
    return names;
}

std::optional<BoxFormat> detect_box_format(const Path& path)
{
    if (!is_file(path))
        return std::nullopt;
    if (path.filename() == "sample_annotation.json")
        return BoxFormat::nuscenes;
    const Path extension = path.extension();
    if (extension == ".txt" && starts_with_a_kitti_label(beginning_of(path)))
        return BoxFormat::kitti;
    if (extension == ".csv" && beginning_of(path).find(kWaymoTableColumn) != std::string::npos)
        return BoxFormat::waymo;
    if (extension == ".json") {
        const std::string text = beginning_of(path);
        if (text.find("\"laserLabels\"") != std::string::npos || text.find("\"laser_labels\"") != std::string::npos)
            return BoxFormat::waymo;
    }
    return std::nullopt;
}

Result<BoxFile> read_box_file(const Path& path, BoxFormat format, const BoxOptions& options)
{
    SR_CHECK(check_options(format, options));
    const BoxReader& reader = kReaders[size_t(format)];
    SR_TRY(BoxCollector collector, BoxCollector::create(reader.labels(), options.map, options.origin));
    SR_CHECK(reader.read(path, options, collector));
    BoxFile file;
    SR_TRY(file.objects, collector.finish(quote_path(path)));
    file.warnings = collector.warnings();
    file.dropped = collector.dropped();
    return file;
}

} // namespace semrover
