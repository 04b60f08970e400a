// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// nuScenes v1.0: v1.0-trainval/*.json, samples/CHANNEL, sweeps/CHANNEL, maps. Every drive is a scene of one of
// nuScenes' own names, in a log of its own, in a world that is moved so that its map begins at the origin.
#include "engine/format/image.h"
#include "engine/scene/palette.h"
#include "runtime/base/quote.h"
#include "tools/export/map_mask.h"
#include "tools/export/nuscenes_scenes.h"
#include "tools/export/nuscenes_tables.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

using OrderedJson = nlohmann::ordered_json;

constexpr int64_t kKeyEvery = 500000, kNearly = 1000; // microseconds between samples, which have annotations
constexpr double kMapMetres = 0.1;                    // a pixel
constexpr double kSurface = 0.01;                     // metres: a point on a box' face is in it
constexpr double kMovingFrom = 0.2;                   // m/s

std::string channel_of(const std::string& camera)
{
    std::string name = camera.empty() ? "FRONT" : camera;
    std::ranges::transform(name, name.begin(),
                           [](unsigned char c) { return std::isalnum(c) ? char(std::toupper(c)) : '_'; });
    return "CAM_" + name;
}

std::array<double, 4> w_first(const Rigid& pose)
{
    const Quaternion q = quaternion_of(pose);
    return {q[3], q[0], q[1], q[2]};
}

// tokens of the record before and behind, in a row of records
OrderedJson with_neighbours(OrderedJson record, const std::string& before, const std::string& behind)
{
    record["prev"] = before;
    record["next"] = behind;
    return record;
}

class NuscenesScene {
  public:
    NuscenesScene(const DriveInput& drive, std::string name, const Path& out, const ExportOptions& options,
                  NuscenesTables& tables, ExportReport& report)
        : drive_(drive), name_(std::move(name)), out_(out), options_(options), tables_(tables), report_(report)
    {
        for (size_t m = 0; m < drive.record.moments.size(); ++m)
            if (keys_.empty() ||
                drive.record.moments[m].time + kNearly >= drive.record.moments[keys_.back()].time + kKeyEvery)
                keys_.push_back(m);
    }

    Status write()
    {
        for (const Sensor& sensor : drive_.record.sensors)
            SR_CHECK(check_pinhole(sensor, "nuScenes"));
        SR_CHECK(add_map());
        add_scene();
        for (size_t m = 0; m < drive_.record.moments.size(); ++m)
            add_pose(m);
        for (const Sensor& sensor : drive_.record.sensors)
            SR_CHECK(add_sensor(sensor));
        if (drive_.lidar.there())
            SR_CHECK(add_lidar());
        return add_annotations();
    }

  private:
    std::string key(size_t number) const { return fmt::format("{}/{}", name_, number); }
    std::string sample_token(size_t key_number) const { return NuscenesTables::token("sample", key(key_number)); }

    Status add_map()
    {
        SR_TRY(const MapMask mask, map_mask_of(drive_, kMapMetres));
        moved_[3] = -mask.left;
        moved_[7] = -mask.bottom;
        if (!mask.known)
            report_.warnings.push_back(
                fmt::format("{} has no labels and depths: its map is empty", quote_path(drive_.folder)));
        SR_TRY(const auto png, encode_png_gray8(mask.width, mask.height, mask.pixels));
        const std::string log = tables_.add("log", name_,
                                            {{"logfile", drive_.name},
                                             {"vehicle", "semrover"},
                                             {"date_captured", "1970-01-01"},
                                             {"location", "semrover"}});
        const std::string file = fmt::format("maps/{}.png", NuscenesTables::token("map", name_));
        tables_.add("map", name_,
                    {{"category", "semantic_prior"}, {"filename", file}, {"log_tokens", OrderedJson::array({log})}});
        return put_file(out_ / file, png);
    }
    void add_scene()
    {
        tables_.add(
            "scene", name_,
            {{"log_token", NuscenesTables::token("log", name_)},
             {"nbr_samples", keys_.size()},
             {"first_sample_token", sample_token(0)},
             {"last_sample_token", sample_token(keys_.size() - 1)},
             {"name", name_},
             {"description", fmt::format("{}, its world moved by {:g}, {:g} m", drive_.name, moved_[3], moved_[7])}});
        for (size_t i = 0; i < keys_.size(); ++i)
            tables_.add("sample", key(i),
                        with_neighbours({{"timestamp", drive_.record.moments[keys_[i]].time},
                                         {"scene_token", NuscenesTables::token("scene", name_)}},
                                        i ? sample_token(i - 1) : "", i + 1 < keys_.size() ? sample_token(i + 1) : ""));
    }
    void add_pose(size_t moment)
    {
        const Rigid pose = compose(moved_, drive_.record.moments[moment].vehicle_to_world);
        tables_.add("ego_pose", key(moment),
                    {{"timestamp", drive_.record.moments[moment].time},
                     {"rotation", w_first(pose)},
                     {"translation", translation_of(pose)}});
    }
    // of a moment: the sample itself, or the next one; behind the last one the last
    size_t sample_of(size_t moment) const
    {
        const auto found = std::ranges::lower_bound(keys_, moment);
        return std::min(size_t(found - keys_.begin()), keys_.size() - 1);
    }
    Status add_sensor(const Sensor& sensor)
    {
        const std::string channel = channel_of(sensor.name);
        const Intrinsics& k = sensor.intrinsics;
        if (channels_.insert(channel).second == false)
            return fail(ErrorCode::bad_input, "two cameras of {} would both be {}", quote_path(drive_.folder), channel);
        add_calibration(channel, "camera", sensor.sensor_to_vehicle,
                        OrderedJson::array({{k.fx, 0, k.cx}, {0, k.fy, k.cy}, {0, 0, 1}}));
        std::vector<std::pair<size_t, size_t>> pictures; // and their moments
        for (size_t m = 0; m < drive_.of_moments.size(); ++m)
            for (const size_t picture : drive_.of_moments[m])
                if (drive_.path.frames[picture].camera == sensor.name)
                    pictures.emplace_back(picture, m);
        for (size_t i = 0; i < pictures.size(); ++i) {
            SR_TRY(const auto color, color_file(drive_, pictures[i].first, true, options_.quality));
            SR_CHECK(add_data({channel, "jpg", i, pictures.size(), pictures[i].second, k.width, k.height}, color));
            ++report_.pictures;
        }
        return {};
    }
    void add_calibration(const std::string& channel, const char* modality, const Rigid& mount, OrderedJson intrinsic)
    {
        tables_.add_once("sensor", channel, {{"channel", channel}, {"modality", modality}});
        tables_.add("calibrated_sensor", name_ + channel,
                    {{"sensor_token", NuscenesTables::token("sensor", channel)},
                     {"translation", translation_of(mount)},
                     {"rotation", w_first(mount)},
                     {"camera_intrinsic", std::move(intrinsic)}});
    }
    Status add_lidar()
    {
        const std::string channel = "LIDAR_TOP";
        add_calibration(channel, "lidar", drive_.lidar.sensor_to_vehicle, OrderedJson::array());
        const size_t count = drive_.lidar.scans.size();
        for (size_t i = 0; i < count; ++i) {
            SR_TRY(const auto points, read_scan(drive_.lidar.scans[i].points));
            const auto bytes = scan_rows(points, [](const ScanPoint& p) {
                return std::array{p[0], p[1], p[2], 255 * p[3], p[4]};
            });
            SR_CHECK(add_data({channel, "pcd", i, count, i, 0, 0}, bytes));
            ++report_.scans;
        }
        return {};
    }
    std::string data_key(const std::string& channel, size_t number) const
    {
        return fmt::format("{}/{}/{}", name_, channel, number);
    }
    struct Data {
        const std::string& channel;
        const char* format;
        size_t number, count; // of its channel's
        size_t moment;
        uint32_t width, height; // of a picture
    };
    Status add_data(const Data& d, std::span<const std::byte> bytes)
    {
        const int64_t time = drive_.record.moments[d.moment].time;
        const bool is_key = std::ranges::binary_search(keys_, d.moment);
        const std::string file = fmt::format("{0}/{1}/{2}__{1}__{3:016}.{4}", is_key ? "samples" : "sweeps", d.channel,
                                             name_, time, std::string_view(d.format) == "pcd" ? "pcd.bin" : d.format);
        SR_CHECK(put_file(out_ / file, bytes));
        const auto token = [&](size_t i) { return NuscenesTables::token("sample_data", data_key(d.channel, i)); };
        OrderedJson record{{"sample_token", sample_token(sample_of(d.moment))},
                           {"ego_pose_token", NuscenesTables::token("ego_pose", key(d.moment))},
                           {"calibrated_sensor_token", NuscenesTables::token("calibrated_sensor", name_ + d.channel)},
                           {"timestamp", time},
                           {"fileformat", d.format},
                           {"is_key_frame", is_key},
                           {"height", d.height},
                           {"width", d.width},
                           {"filename", file}};
        tables_.add("sample_data", data_key(d.channel, d.number),
                    with_neighbours(std::move(record), d.number ? token(d.number - 1) : "",
                                    d.number + 1 < d.count ? token(d.number + 1) : ""));
        return {};
    }
    // of what cameras see at samples
    Status add_annotations()
    {
        const std::vector<Track> tracks = drive_.tracks();
        SR_TRY(const auto points, points_in(tracks));
        for (const Track& track : tracks) {
            const char* category = nuscenes_category(track.label);
            std::vector<size_t> places;
            for (size_t i = 0; i < track.places.size(); ++i)
                if (std::ranges::binary_search(keys_, track.places[i].moment))
                    places.push_back(i);
            if (!category && !places.empty())
                report_.left_out[label_name(track.label)] += places.size();
            if (category && !places.empty())
                add_instance(track, places, category, points);
        }
        return {};
    }
    using PointCounts = std::map<std::pair<uint32_t, size_t>, size_t>; // of an object and moment
    // points of the lidar in boxes at samples
    Result<PointCounts> points_in(std::span<const Track> tracks) const
    {
        PointCounts counts;
        for (const size_t moment : drive_.lidar.there() ? keys_ : std::vector<size_t>()) {
            const RecordedSweep& scan = drive_.lidar.scans[moment];
            SR_TRY(const auto points, read_scan(scan.points));
            for (const Track& track : tracks) {
                const auto place = std::ranges::find(track.places, moment, &Track::Place::moment);
                if (place == track.places.end() || !nuscenes_category(track.label))
                    continue;
                const Rigid to_box = compose(inverse(place->pose), scan.to_world);
                counts[{track.id, moment}] = size_t(std::ranges::count_if(points, [&](const ScanPoint& p) {
                    const Point3 at = transform(to_box, {p[0], p[1], p[2]});
                    return std::abs(at[0]) <= track.size[0] / 2 + kSurface &&
                           std::abs(at[1]) <= track.size[1] / 2 + kSurface &&
                           std::abs(at[2]) <= track.size[2] / 2 + kSurface;
                }));
            }
        }
        return counts;
    }
    void add_instance(const Track& track, std::span<const size_t> places, const char* category,
                      const PointCounts& points)
    {
        const auto number = [&](size_t i) { return fmt::format("{}/{}/{}", name_, track.id, i); };
        const auto token = [&](size_t i) { return NuscenesTables::token("sample_annotation", number(i)); };
        const std::string instance = tables_.add("instance", key(track.id),
                                                 {{"category_token", NuscenesTables::token("category", category)},
                                                  {"nbr_annotations", places.size()},
                                                  {"first_annotation_token", token(0)},
                                                  {"last_annotation_token", token(places.size() - 1)}});
        for (size_t i = 0; i < places.size(); ++i) {
            OrderedJson record = annotation(track, places[i], instance);
            const auto count = points.find({track.id, track.places[places[i]].moment});
            record["num_lidar_pts"] = count == points.end() ? 0 : count->second;
            tables_.add(
                "sample_annotation", number(i),
                with_neighbours(std::move(record), i ? token(i - 1) : "", i + 1 < places.size() ? token(i + 1) : ""));
        }
        report_.boxes += places.size();
    }
    OrderedJson annotation(const Track& track, size_t place, const std::string& instance) const
    {
        const Track::Place& at = track.places[place];
        const Rigid pose = compose(moved_, at.pose);
        const bool moves_now = drive_.speed(track, place) > kMovingFrom;
        const char* attribute = nuscenes_attribute(track.label, moves_now, track.moves());
        return {{"sample_token", sample_token(sample_of(at.moment))},
                {"instance_token", instance},
                {"visibility_token", nuscenes_visibility(at.shown)},
                {"attribute_tokens", OrderedJson::array({NuscenesTables::token("attribute", attribute)})},
                {"translation", translation_of(pose)},
                {"size", {track.size[1], track.size[0], track.size[2]}},
                {"rotation", w_first(pose)},
                {"num_lidar_pts", 0},
                {"num_radar_pts", 0}};
    }

    const DriveInput& drive_;
    std::string name_;
    const Path& out_;
    const ExportOptions& options_;
    NuscenesTables& tables_;
    ExportReport& report_;
    std::vector<size_t> keys_; // moments that are samples
    std::set<std::string> channels_;
    Rigid moved_ = kIdentity; // the drive's world to that of the map
};

} // namespace

Result<ExportReport> export_nuscenes(std::span<const DriveInput> drives, const Path& out, const ExportOptions& options)
{
    const std::vector<std::string> train = nuscenes_train_scenes(), val = nuscenes_val_scenes();
    const size_t test = std::min<size_t>(options.val, drives.size()), most = train.size();
    if (drives.size() - test > most || test > val.size())
        return fail(ErrorCode::usage, "{} drives and {} for `val`: nuScenes has {} and {} scenes", drives.size() - test,
                    test, most, val.size());
    ExportReport report;
    NuscenesTables tables;
    for (size_t i = 0; i < drives.size(); ++i) {
        const size_t trained = drives.size() - test;
        const std::string& name = i < trained ? train[i] : val[i - trained];
        SR_CHECK(NuscenesScene(drives[i], name, out, options, tables, report).write());
    }
    SR_CHECK(tables.write(out / "v1.0-trainval"));
    return report;
}

} // namespace semrover
