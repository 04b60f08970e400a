// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// What drivestudio (OmniRe and others) makes of Waymo's drives: a folder NNN a drive with images/TTT_C.jpg,
// ego_pose/TTT.txt, extrinsics/C.txt, intrinsics/C.txt, sky_masks/TTT_C.png,
// dynamic_masks/{all,human,vehicle}/TTT_C.png and instances/. Source: the page Waymo.md and datasets/waymo/*.py of
// https://github.com/ziyc/drivestudio
#include "engine/format/number_image.h"
#include "engine/scene/palette.h"
#include "engine/scene/scene_fields.h"
#include "runtime/base/quote.h"
#include "tools/export/export_files.h"

#include <algorithm>
#include <set>

namespace semrover {

namespace {

constexpr uint8_t kSkyClass = 10;
constexpr double kDynamicFrom = 1; // m/s

const char* waymo_type(uint8_t label)
{
    if (label == 11)
        return "Pedestrian";
    if (label == 12)
        return "Cyclist";
    return label >= 13 && label <= 17 ? "Vehicle" : nullptr;
}

class DriveStudioScene {
  public:
    DriveStudioScene(const DriveInput& drive, const Path& folder, const ExportOptions& options, ExportReport& report)
        : drive_(drive), folder_(folder), options_(options), report_(report)
    {
        for (Track& track : drive.tracks())
            if (waymo_type(track.label))
                tracks_.push_back(std::move(track));
            else
                report_.left_out[label_name(track.label)] += track.places.size();
    }

    Status write()
    {
        for (size_t c = 0; c < drive_.record.sensors.size(); ++c)
            SR_CHECK(write_sensor(drive_.record.sensors[c], c));
        for (size_t t = 0; t < drive_.record.moments.size(); ++t) {
            SR_CHECK(put_file(folder_ / "ego_pose" / fmt::format("{:03}.txt", t),
                              matrix_text(drive_.record.moments[t].vehicle_to_world)));
            for (const size_t picture : drive_.of_moments[t])
                SR_CHECK(write_picture(picture, t));
            if (drive_.lidar.there())
                SR_CHECK(write_scan(t));
        }
        return drive_.boxes.empty() ? Status() : write_instances();
    }

  private:
    // fx fy cx cy k1 k2 p1 p2 k3, a line each
    Status write_sensor(const Sensor& sensor, size_t number)
    {
        const Intrinsics& k = sensor.intrinsics;
        const auto& d = k.distortion;
        const bool fits =
            k.model == CameraModel::pinhole ||
            (k.model == CameraModel::opencv && std::all_of(d.begin() + 5, d.end(), [](double v) { return v == 0; }));
        if (!fits)
            return fail(ErrorCode::bad_input, "camera {}: drivestudio holds pinholes with up to k1 k2 p1 p2 k3, not {}",
                        quote(sensor.name), name_of(k.model));
        const double numbers[] = {k.fx, k.fy, k.cx, k.cy, d[0], d[1], d[2], d[3], d[4]};
        const std::string name = fmt::format("{}.txt", number);
        SR_CHECK(put_file(folder_ / "intrinsics" / name, fmt::format("{}\n", fmt::join(numbers, "\n"))));
        return put_file(folder_ / "extrinsics" / name, matrix_text(forward_to_vehicle(sensor)));
    }
    Status write_picture(size_t picture, size_t moment)
    {
        const Sensor* sensor = drive_.record.sensor(drive_.path.frames[picture].camera);
        const std::string name = fmt::format("{:03}_{}", moment, sensor - drive_.record.sensors.data());
        SR_TRY(const auto color, color_file(drive_, picture, true, options_.quality));
        SR_CHECK(put_file(folder_ / "images" / (name + ".jpg"), color));
        ++report_.pictures;
        SR_TRY(const std::optional<Path> label_file, drive_.other(picture, "label"));
        if (label_file) {
            SR_TRY(const LabelImage labels, read_label_image(*label_file));
            SR_CHECK(write_mask("sky_masks", name, labels.size, labels.numbers,
                                [](uint16_t label) { return label == kSkyClass; }));
        } else {
            no_sky_ = true;
        }
        SR_TRY(const std::optional<Path> file, drive_.other(picture, "instance"));
        if (!file || drive_.boxes.empty())
            return {};
        SR_TRY(const ImageGray16 image, read_png_gray16(*file));
        return write_dynamic_masks(image, name, moment);
    }
    // 14 numbers a point, in the vehicle's axes: origin, place, flow (unknown: 0), its class (-1: none), ground,
    // intensity, elongation, laser
    Status write_scan(size_t moment)
    {
        SR_TRY(const auto points, read_scan(drive_.lidar.scans[moment].points));
        const Rigid& mount = drive_.lidar.sensor_to_vehicle;
        const auto bytes = scan_rows(points, [&](const ScanPoint& p) {
            const Point3 at = transform(mount, {p[0], p[1], p[2]});
            const uint32_t label = uint32_t(p[6]);
            return std::array{float(mount[3]),
                              float(mount[7]),
                              float(mount[11]),
                              float(at[0]),
                              float(at[1]),
                              float(at[2]),
                              0.f,
                              0.f,
                              0.f,
                              -1.f,
                              label < kClassCount && is_ground(uint8_t(label)) ? 1.f : 0.f,
                              p[3],
                              0.f,
                              0.f};
        });
        ++report_.scans;
        return put_file(folder_ / "lidar" / fmt::format("{:03}.bin", moment), bytes);
    }
    template <typename Chosen>
    Status write_mask(const Path& kind, const std::string& name, const ImageSize& size,
                      std::span<const uint16_t> numbers, const Chosen& chosen)
    {
        std::vector<uint8_t> mask(numbers.size());
        std::ranges::transform(numbers, mask.begin(), [&](uint16_t n) { return uint8_t(chosen(n) ? 255 : 0); });
        SR_TRY(const auto png, encode_png_gray8(size.width, size.height, mask));
        return put_file(folder_ / kind / (name + ".png"), png);
    }
    // of what moves at the moment
    Status write_dynamic_masks(const ImageGray16& image, const std::string& name, size_t moment)
    {
        std::set<uint16_t> people, vehicles;
        for (const Track& track : tracks_) {
            const auto place = std::ranges::find(track.places, moment, &Track::Place::moment);
            if (place != track.places.end() && drive_.speed(track, size_t(place - track.places.begin())) > kDynamicFrom)
                (track.label == 11 || track.label == 12 ? people : vehicles)
                    .insert(uint16_t(instance_number(track.id)));
        }
        const ImageSize size{image.width, image.height};
        const auto is_person = [&](uint16_t n) { return people.contains(n); };
        const auto is_vehicle = [&](uint16_t n) { return vehicles.contains(n); };
        const Path masks = "dynamic_masks";
        SR_CHECK(write_mask(masks / "all", name, size, image.pixels,
                            [&](uint16_t n) { return is_person(n) || is_vehicle(n); }));
        SR_CHECK(write_mask(masks / "human", name, size, image.pixels, is_person));
        return write_mask(masks / "vehicle", name, size, image.pixels, is_vehicle);
    }
    Status write_instances()
    {
        nlohmann::ordered_json info = nlohmann::ordered_json::object(), frames = nlohmann::ordered_json::object();
        for (size_t t = 0; t < drive_.record.moments.size(); ++t)
            frames[std::to_string(t)] = nlohmann::ordered_json::array();
        for (size_t i = 0; i < tracks_.size(); ++i) {
            const Track& track = tracks_[i];
            nlohmann::ordered_json places{
                {"frame_idx", Json::array()}, {"obj_to_world", Json::array()}, {"box_size", Json::array()}};
            for (const Track::Place& place : track.places) {
                auto rows = nlohmann::ordered_json::array();
                for (size_t row = 0; row < 4; ++row)
                    rows.push_back(std::span(place.pose).subspan(4 * row, 4));
                places["frame_idx"].push_back(place.moment);
                places["obj_to_world"].push_back(std::move(rows));
                places["box_size"].push_back(track.size);
                frames[std::to_string(place.moment)].push_back(i);
                ++report_.boxes;
            }
            info[std::to_string(i)] = {{"id", std::to_string(track.id)},
                                       {"class_name", waymo_type(track.label)},
                                       {"frame_annotations", std::move(places)}};
        }
        SR_CHECK(put_file(folder_ / "instances" / "instances_info.json", json_text(info, 1) + "\n"));
        return put_file(folder_ / "instances" / "frame_instances.json", json_text(frames, 1) + "\n");
    }

  public:
    bool lacks_sky() const { return no_sky_; }

  private:
    const DriveInput& drive_;
    Path folder_;
    const ExportOptions& options_;
    ExportReport& report_;
    std::vector<Track> tracks_;
    bool no_sky_ = false;
};

} // namespace

Result<ExportReport> export_drivestudio(std::span<const DriveInput> drives, const Path& out,
                                        const ExportOptions& options)
{
    ExportReport report;
    for (size_t i = 0; i < drives.size(); ++i) {
        DriveStudioScene scene(drives[i], out / fmt::format("{:03}", i), options, report);
        SR_CHECK(scene.write());
        if (scene.lacks_sky())
            report.warnings.push_back(
                fmt::format("{} has no labels: drivestudio wants sky_masks", quote_path(drives[i].folder)));
    }
    return report;
}

} // namespace semrover
