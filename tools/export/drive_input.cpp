// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/export/drive_input.h"

#include "engine/format/buffer_folder.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr double kStill = 0.05, kSameTurn = 0.01; // metres; of a matrix' numbers

double distance(const Rigid& a, const Rigid& b)
{
    const Point3 p = translation_of(a), q = translation_of(b);
    return std::hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]);
}

bool differ(const Rigid& a, const Rigid& b)
{
    if (distance(a, b) > kStill)
        return true;
    for (const size_t i : {0, 1, 2, 4, 5, 6, 8, 9, 10})
        if (std::abs(a[i] - b[i]) > kSameTurn)
            return true;
    return false;
}

std::string plain_name(const Path& folder)
{
    std::string name = (folder.has_filename() ? folder : folder.parent_path()).filename().string();
    for (char& c : name)
        if (!std::isalnum(static_cast<unsigned char>(c)) && c != '-')
            c = '_';
    return name;
}

Status read_boxes(const Path& file, DriveInput& drive)
{
    if (!is_file(file))
        return {};
    SR_TRY(std::vector<SeenPicture> lines, read_box_lines(file));
    const auto key = [](const DriveRecord::Picture& p) { return std::pair(p.camera, p.number); };
    std::map<std::pair<std::string, uint32_t>, SeenPicture> by_name;
    for (SeenPicture& line : lines)
        by_name[key(line.picture)] = std::move(line);
    for (const DriveRecord::Picture& p : drive.record.pictures) {
        const auto found = by_name.find(key(p));
        if (found == by_name.end() || found->second.picture.time != p.time)
            return fail(ErrorCode::bad_input, "{}: no line of picture {} of camera {} at {} us", quote_path(file),
                        p.number, quote(p.camera), p.time);
        drive.boxes.push_back(std::move(found->second));
    }
    return {};
}

} // namespace

bool Track::moves() const
{
    return std::ranges::any_of(places, [this](const Place& p) { return differ(p.pose, places.front().pose); });
}

Result<Path> DriveInput::color(size_t picture) const
{
    const DriveRecord::Picture& p = record.pictures[picture];
    std::vector<Path> missing;
    for (const Path& kind : {camera_folder(folder / "frames", p.camera), camera_folder(folder, p.camera) / "color"}) {
        SR_TRY(Path found, find_picture(kind.parent_path(), kind.filename().string().c_str(), p.number));
        if (is_file(found))
            return found;
        missing.push_back(std::move(found));
    }
    return fail(ErrorCode::bad_input, "{} is missing, and so is {}", quote_path(missing[1]), quote_path(missing[0]));
}

Result<std::optional<Path>> DriveInput::other(size_t picture, const char* kind) const
{
    const DriveRecord::Picture& p = record.pictures[picture];
    for (const Path& base : {folder / "buffers", folder}) {
        SR_TRY(const Path found, find_picture(camera_folder(base, p.camera), kind, p.number));
        if (is_file(found))
            return std::optional(found);
    }
    return std::optional<Path>();
}

Result<ImageRgb8> DriveInput::read_color(size_t picture) const
{
    SR_TRY(const Path file, color(picture));
    SR_TRY(ImageRgb8 image, read_image_rgb8(file));
    const Intrinsics& k = path.frames[picture].intrinsics;
    if (image.width != k.width || image.height != k.height)
        return fail(ErrorCode::bad_input, "{} is {} x {} pixels, its calibration says {} x {}", quote_path(file),
                    image.width, image.height, k.width, k.height);
    return image;
}

std::vector<Track> DriveInput::tracks() const
{
    std::map<uint32_t, Track> tracks;
    for (size_t moment = 0; moment < of_moments.size(); ++moment)
        for (const size_t picture : of_moments[moment]) {
            if (boxes.empty())
                continue;
            for (const SeenObject& o : boxes[picture].objects) {
                Track& track = tracks[o.id];
                track.id = o.id;
                track.label = o.label;
                track.size = o.box.size;
                if (track.places.empty() || track.places.back().moment != moment)
                    track.places.push_back({moment, o.box.pose, 0});
                const double shown = (1 - o.occlusion) * (1 - o.truncation);
                track.places.back().shown = std::max(track.places.back().shown, shown);
            }
        }
    std::vector<Track> list;
    for (auto& [id, track] : tracks)
        list.push_back(std::move(track));
    return list;
}

double DriveInput::speed(const Track& track, size_t place) const
{
    if (track.places.size() < 2)
        return 0;
    const size_t first = std::min(place, track.places.size() - 2);
    const Track::Place &a = track.places[first], &b = track.places[first + 1];
    const double seconds = double(record.moments[b.moment].time - record.moments[a.moment].time) * 1e-6;
    return distance(a.pose, b.pose) / seconds;
}

Result<DriveInput> open_drive(const Path& folder)
{
    DriveInput drive;
    drive.folder = folder;
    drive.name = plain_name(folder);
    SR_TRY(drive.shards, open_if_shards(folder));
    SR_TRY(drive.record, read_drive_record(folder));
    drive.path = path_of(drive.record);
    drive.of_moments.resize(drive.record.moments.size());
    for (size_t i = 0; i < drive.record.pictures.size(); ++i) {
        const DriveRecord::Moment* moment = drive.record.moment(drive.record.pictures[i].time);
        drive.of_moments[size_t(moment - drive.record.moments.data())].push_back(i);
    }
    SR_TRY(drive.lidar, read_lidar_scans(folder, drive.record));
    SR_CHECK(read_boxes(folder / kBoxesName, drive));
    return drive;
}

} // namespace semrover
