// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// InfiniCube's WebDataset: an archive a clip and attribute, ATTRIBUTE/CLIP.tar, whose members are CLIP.NNNNNN.FIELD of
// moments, or CLIP.FIELD. Source: infinicube/data_process/waymo2webdataset.py, generate_additional_attributes.py and
// infinicube/voxelgen/data/waymo_wds.py of https://github.com/nv-tlabs/InfiniCube
#include "engine/format/depth_picture.h"
#include "engine/format/npy.h"
#include "engine/format/number_image.h"
#include "engine/scene/palette.h"
#include "engine/shards/ustar.h"
#include "runtime/base/quote.h"
#include "tools/export/export_files.h"

#include <algorithm>
#include <set>

namespace semrover {

namespace {

constexpr double kUnitsPerMetre = 100;                      // of depth
constexpr double kMovesFrom = 0.5;                          // m/s: 5 cm in 0.1 s
constexpr uint32_t kFirstStatic = 1, kFirstDynamic = 10000; // numbers of objects
constexpr uint8_t kSkyLabel = 10;

// numbers of Waymo's classes, as infinicube/utils/semantic_utils.py lists them
constexpr std::array<uint8_t, kClassCount> kWaymoClass = {
    18, // road: ROAD
    22, // sidewalk: SIDEWALK
    14, // building: BUILDING
    14, // wall: BUILDING
    0,  // fence: UNDEFINED
    10, // pole: POLE
    9,  // traffic light: TRAFFIC_LIGHT
    8,  // traffic sign: SIGN
    15, // vegetation: VEGETATION
    20, // terrain: OTHER_GROUND
    0,  // sky: UNDEFINED
    7,  // person: PEDESTRIAN
    6,  // rider: BICYCLIST
    1,  // car: CAR
    2,  // truck: TRUCK
    3,  // bus: BUS
    4,  // train: OTHER_VEHICLE
    13, // motorcycle: MOTORCYCLE
    12, // bicycle: BICYCLE
    19, // road-lane: LANE_MARKER
};

const char* object_type(uint8_t label)
{
    if (label == 11)
        return "pedestrian";
    if (label == 12)
        return "cyclist";
    if (label >= 13 && label <= 17)
        return "car"; // Waymo's vehicle
    return label == 7 ? "sign" : nullptr;
}

class Archive {
  public:
    static Result<Archive> create(const Path& path)
    {
        SR_CHECK(make_folder(path.parent_path()));
        SR_TRY(AtomicFile file, AtomicFile::create(path));
        return Archive(std::move(file));
    }
    Status add(const std::string& name, std::span<const std::byte> bytes)
    {
        if (name.size() > kMostTarName || bytes.size() > kMostTarFile)
            return fail(ErrorCode::bad_input,
                        "{} of {} bytes: an archive holds names of up to {} and files of up to {}", quote(name),
                        bytes.size(), kMostTarName, kMostTarFile);
        const TarHeader header = tar_header(name, bytes.size());
        SR_CHECK(file_.write(std::as_bytes(std::span(header))));
        SR_CHECK(file_.write(bytes));
        return file_.write(std::span(kZeros).first(tar_padded(bytes.size()) - bytes.size()));
    }
    Status finish()
    {
        SR_CHECK(file_.write(kZeros));
        return file_.commit();
    }

  private:
    explicit Archive(AtomicFile file) : file_(std::move(file)) {}

    static constexpr std::array<std::byte, kTarEnd> kZeros{};
    AtomicFile file_;
};

std::vector<std::byte> npy_of(std::span<const double> values, std::vector<uint64_t> shape)
{
    const auto bytes = std::as_bytes(values);
    return encode_npy({DType::f64, std::move(shape), {bytes.begin(), bytes.end()}});
}

std::vector<std::byte> bytes_of(const std::string& text)
{
    const auto bytes = std::as_bytes(std::span(text));
    return {bytes.begin(), bytes.end()};
}

Json rows_of(const Rigid& matrix)
{
    Json rows = Json::array();
    for (size_t row = 0; row < 4; ++row)
        rows.push_back(std::span(matrix).subspan(4 * row, 4));
    return rows;
}

class InfiniCubeClip {
  public:
    InfiniCubeClip(const DriveInput& drive, const Path& out, const ExportOptions& options, ExportReport& report)
        : drive_(drive), out_(out), options_(options), report_(report)
    {
        for (Track& track : drive.tracks())
            if (object_type(track.label))
                (track.moves() ? dynamic_ : static_).push_back(std::move(track));
            else
                report_.left_out[label_name(track.label)] += track.places.size();
        for (size_t i = 0; i < static_.size(); ++i)
            numbers_[static_[i].id] = kFirstStatic + uint32_t(i);
        for (size_t i = 0; i < dynamic_.size(); ++i)
            numbers_[dynamic_[i].id] = kFirstDynamic + uint32_t(i);
    }

    Status write()
    {
        for (const Sensor& sensor : drive_.record.sensors)
            SR_CHECK(add_sensor(sensor));
        for (size_t i = 0; i < drive_.record.pictures.size(); ++i)
            SR_CHECK(add_picture(i));
        if (!drive_.boxes.empty())
            for (size_t moment = 0; moment < drive_.of_moments.size(); ++moment) {
                SR_CHECK(add_objects(moment, static_, true));
                SR_CHECK(add_objects(moment, dynamic_, false));
            }
        for (auto& [attribute, archive] : archives_)
            SR_CHECK(archive.finish());
        return {};
    }

  private:
    static std::string camera_name(const std::string& camera)
    {
        std::string name = camera.empty() ? "front" : camera;
        std::ranges::transform(name, name.begin(), [](char c) { return c == '.' ? '_' : char(std::tolower(c)); });
        return name;
    }
    Status add(const std::string& attribute, const std::string& field, std::span<const std::byte> bytes)
    {
        auto archive = archives_.find(attribute);
        if (archive == archives_.end()) {
            SR_TRY(Archive made, Archive::create(out_ / attribute / (drive_.name + ".tar")));
            archive = archives_.emplace(attribute, std::move(made)).first;
        }
        return archive->second.add(drive_.name + "." + field, bytes);
    }
    Status add_sensor(const Sensor& sensor)
    {
        SR_CHECK(check_pinhole(sensor, "InfiniCube"));
        const std::string camera = camera_name(sensor.name);
        const Intrinsics& k = sensor.intrinsics;
        const double lens[] = {k.fx, k.fy, k.cx, k.cy, double(k.width), double(k.height)};
        SR_CHECK(add("intrinsic", fmt::format("intrinsic.{}.npy", camera), npy_of(lens, {6})));
        return add("extrinsic", fmt::format("extrinsic.{}.npy", camera), npy_of(forward_to_vehicle(sensor), {4, 4}));
    }
    Status add_picture(size_t picture)
    {
        const CameraFrame& frame = drive_.path.frames[picture];
        const std::string camera = camera_name(frame.camera);
        const auto field = [&](const char* what, const char* ending) {
            return fmt::format("{:06}.{}.{}.{}", drive_.record.pictures[picture].number, what, camera, ending);
        };
        SR_CHECK(add("pose", field("pose", "npy"), npy_of(frame.pose.camera_to_world(), {4, 4})));
        SR_TRY(const auto color, color_file(drive_, picture, true, options_.quality));
        SR_CHECK(add("image_" + camera, field("image", "jpg"), color));
        ++report_.pictures;
        SR_CHECK(add_labels(picture, camera, field("skymask", "png"), field("semantic_buffer", "png")));
        SR_CHECK(add_depth(picture, camera, field("voxel_depth_100", "png")));
        return add_instances(picture, camera, field("instance_buffer", "png"));
    }
    Status add_labels(size_t picture, const std::string& camera, const std::string& sky, const std::string& semantic)
    {
        SR_TRY(const std::optional<Path> file, drive_.other(picture, "label"));
        if (!file)
            return {};
        SR_TRY(const LabelImage labels, read_label_image(*file));
        std::vector<uint8_t> mask, classes;
        for (const uint16_t label : labels.numbers) {
            mask.push_back(label == kSkyLabel ? 255 : 0);
            classes.push_back(label < kClassCount ? kWaymoClass[label] : 0);
        }
        SR_TRY(const auto mask_png, encode_png_gray8(labels.size.width, labels.size.height, mask));
        SR_TRY(const auto class_png, encode_png_gray8(labels.size.width, labels.size.height, classes));
        SR_CHECK(add("skymask_" + camera, sky, mask_png));
        return add("semantic_buffer_" + camera, semantic, class_png);
    }
    Status add_depth(size_t picture, const std::string& camera, const std::string& name)
    {
        SR_TRY(const std::optional<Path> file, drive_.other(picture, "depth"));
        if (!file)
            return {};
        SR_TRY(const DepthPicture depth, read_depth_picture(*file, drive_.record.depth_unit));
        std::vector<uint16_t> units;
        for (const uint32_t value : depth.pixels) {
            const double unit = std::floor(value * depth.unit * kUnitsPerMetre);
            units.push_back(unit <= UINT16_MAX ? uint16_t(unit) : 0);
        }
        SR_TRY(const auto png, encode_png_gray16(depth.width, depth.height, units));
        return add("voxel_depth_100_" + camera, name, png);
    }
    Status add_instances(size_t picture, const std::string& camera, const std::string& name)
    {
        SR_TRY(const std::optional<Path> file, drive_.other(picture, "instance"));
        if (!file)
            return {};
        SR_TRY(ImageGray16 image, read_png_gray16(*file));
        for (uint16_t& value : image.pixels) {
            const auto found = value ? numbers_.find(value - 1u) : numbers_.end();
            value = found == numbers_.end() ? 0 : uint16_t(found->second);
        }
        SR_TRY(const auto png, encode_png_gray16(image.width, image.height, image.pixels));
        return add("instance_buffer_" + camera, name, png);
    }
    // What stands is in every moment, what moves where a camera sees it
    Status add_objects(size_t moment, std::span<const Track> tracks, bool stand)
    {
        Json objects = Json::object();
        for (const Track& track : tracks) {
            auto place = std::ranges::find(track.places, moment, &Track::Place::moment);
            if (place == track.places.end() && !stand)
                continue;
            if (place == track.places.end())
                place = track.places.begin();
            const bool moving = !stand && drive_.speed(track, size_t(place - track.places.begin())) > kMovesFrom;
            objects[std::to_string(track.id)] = {{"object_to_world", rows_of(place->pose)},
                                                 {"object_lwh", track.size},
                                                 {"object_is_moving", moving},
                                                 {"object_type", object_type(track.label)},
                                                 {"object_id_int", numbers_.at(track.id)}};
            ++report_.boxes;
        }
        const std::string attribute = stand ? "static_object_info" : "dynamic_object_info";
        return add(attribute, fmt::format("{:06}.{}.json", moment, attribute), bytes_of(json_text(objects)));
    }

    const DriveInput& drive_;
    const Path& out_;
    const ExportOptions& options_;
    ExportReport& report_;
    std::vector<Track> static_, dynamic_;
    std::map<uint32_t, uint32_t> numbers_; // by id
    std::map<std::string, Archive> archives_;
};

} // namespace

Result<ExportReport> export_infinicube(std::span<const DriveInput> drives, const Path& out,
                                       const ExportOptions& options)
{
    ExportReport report;
    std::set<std::string> names;
    for (const DriveInput& drive : drives) {
        if (!names.insert(drive.name).second)
            return fail(ErrorCode::bad_input, "two folders are called {}: a clip is called as its folder",
                        quote(drive.name));
        SR_CHECK(InfiniCubeClip(drive, out, options, report).write());
    }
    return report;
}

} // namespace semrover
