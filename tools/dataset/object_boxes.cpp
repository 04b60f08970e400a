// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/object_boxes.h"

#include "runtime/base/quote.h"
#include "runtime/base/text_start.h"
#include "tools/trajectory/camera_text.h"

namespace semrover {

namespace {

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
