// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/drawing_store.h"

#include "engine/annotation/drive_record.h"
#include "engine/format/buffer_folder.h"
#include "engine/format/image.h"
#include "engine/format/npy.h"
#include "engine/format/transforms.h"
#include "engine/job/outputs.h"
#include "engine/job/path_drawing.h"
#include "runtime/base/final_name.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace semrover {

namespace {

namespace fs = std::filesystem;

constexpr const char* kPictures[] = {"color", "depth", "normal", "label", "visible"};
constexpr const char *kInstances = "instance", *kFlow = "flow", *kFlowStates = "flow_state";
constexpr const char* kArrays[] = {"depth_expected", "depth_median", "alpha"};
constexpr const char* kTop = "top.png";
constexpr const char* kBoxes = "boxes"; // of a frame's entry in the journal
constexpr const char* kPoints = "points.ply";
constexpr const char* kCameras = "transforms.json";

// beside the pictures; not those of boxes, as a scene's folder has an objects.json of its own
std::vector<std::string> single_files()
{
    std::vector<std::string> names{kTop, kPoints, kCameras};
    names.insert(names.end(), std::begin(kDriveRecordFiles), std::end(kDriveRecordFiles));
    return names;
}

// lidars, too
std::set<std::string> cameras_of(const CameraPath& path)
{
    std::set<std::string> cameras;
    for (const CameraFrame& f : path.frames)
        cameras.insert(f.camera);
    for (const LidarSweep& s : path.sweeps)
        cameras.insert(s.sensor);
    return cameras;
}

// where a lidar was: {"format", "version", "sweeps": [{"time", "begin", "end"}]}, its poses to the world
Json sweeps_json(const CameraPath& path, const std::string& lidar)
{
    Json sweeps = Json::array();
    for (const LidarSweep& s : path.sweeps)
        if (s.sensor == lidar)
            sweeps.push_back({{"time", microseconds_of(s.time)},
                              {"duration", microseconds_of(s.lidar->sweep_seconds())},
                              {"begin", matrix_json(s.begin)},
                              {"end", matrix_json(s.end)}});
    return {{"format", kSweepsFormat}, {"version", 1}, {"sweeps", std::move(sweeps)}};
}

// the folders of these cameras' pictures, from the run's folder on
std::vector<std::string> picture_folders(const std::set<std::string>& cameras)
{
    std::vector<std::string> folders;
    for (const std::string& camera : cameras) {
        for (const char* kind : kPictures)
            folders.push_back((camera_folder("", camera) / kind).generic_string());
        for (const char* kind : kArrays)
            folders.push_back((camera_folder("", camera) / kind).generic_string());
        if (!camera.empty())
            folders.push_back((camera_folder("", camera) / kSweepPoints).generic_string());
        for (const char* kind : {kInstances, kFlow, kFlowStates})
            folders.push_back((camera_folder("", camera) / kind).generic_string());
    }
    return folders;
}

// of a drawing that is there already, whichever it is
std::set<std::string> cameras_before(const Path& folder)
{
    std::set<std::string> cameras;
    const auto run = read_json(folder / "run.json");
    const Json settings = run && run->is_object() ? run->value("settings", Json()) : Json();
    if (!settings.is_object() || settings.value("command", Json()) != "render")
        return cameras;
    for (const Json& camera : settings.value("cameras", Json::array()))
        if (camera.is_string() && (camera == "" || is_camera_name(camera.get_ref<const std::string&>())))
            cameras.insert(camera.get<std::string>());
    return cameras;
}

std::string sweep_name(const std::string& lidar, uint32_t number)
{
    return fmt::format("{}/{}/{:06}", lidar, kSweepPoints, number);
}

std::set<std::string> pieces_with_flow(const CameraPath& path)
{
    std::set<std::string> pieces;
    std::map<std::string, uint32_t> counts;
    const std::vector<size_t> following = following_frames(path);
    for (size_t i = 0; i < path.frames.size(); ++i) {
        const std::string& camera = path.frames[i].camera;
        const uint32_t number = counts[camera]++;
        if (following[i] < path.frames.size())
            pieces.insert(frame_key(camera, number));
    }
    return pieces;
}

bool had_boxes_before(const Path& folder)
{
    const auto run = read_json(folder / "run.json");
    const Json settings = run && run->is_object() ? run->value("settings", Json()) : Json();
    const Json drive = settings.is_object() ? settings.value("drive", Json()) : Json();
    return drive.is_object() && drive.value("boxes", Json()) == true;
}

Status make_float_images(const Path& folder, uint32_t number, const SplatImage& image, MadeFiles& files)
{
    const std::vector<float>* const planes[] = {&image.depth_expected, &image.depth_median, &image.alpha};
    for (size_t i = 0; i < std::size(planes); ++i) {
        const auto bytes = std::as_bytes(std::span(*planes[i]));
        SR_CHECK(files.add(frame_path(folder, kArrays[i], number, "npy"),
                           encode_npy({DType::f32, {image.height, image.width}, {bytes.begin(), bytes.end()}})));
    }
    return {};
}

} // namespace

Status DrawingStore::check(const Path& folder, const CameraPath& path, bool replace)
{
    if (replace || is_there(folder / "run.json")) // whether it may go on is known by its settings
        return {};
    std::vector<std::string> names = picture_folders(cameras_of(path));
    std::ranges::copy(single_files(), std::back_inserter(names));
    for (const std::string& name : names)
        SR_CHECK(refuse_existing(folder / name, false));
    return {};
}

Result<std::unique_ptr<DrawingStore>> DrawingStore::open(const Path& folder, const Json& settings,
                                                         const CameraPath& path, const DrawnFiles& files, bool replace)
{
    SR_CHECK(check(folder, path, replace));
    for (const char* name : {kBoxesName, kObjectsName})
        if (files.boxes && !is_file(folder / "run.json"))
            SR_CHECK(refuse_existing(folder / name, replace));
    std::set<std::string> cameras = cameras_of(path);
    Json with_cameras = settings;
    with_cameras["cameras"] = cameras;
    with_cameras["files"] = {{"npy", files.floats}, {"top", files.top}, {"points", files.points}};
    if (!path.sweeps.empty())
        with_cameras["files"]["lidar"] = kLidarFormats[size_t(files.lidar)];
    cameras.merge(cameras_before(folder));
    RunContents contents{{}, single_files(), picture_folders(cameras)};
    if (files.boxes || had_boxes_before(folder))
        contents.results.insert(contents.results.end(), {kBoxesName, kObjectsName});
    for (const std::string& camera : cameras)
        if (!camera.empty())
            contents.results.push_back((camera_folder("", camera) / kSweepsName).generic_string());
    SR_TRY(RunFolder run, open_run(folder, with_cameras, replace, contents, true));
    return std::unique_ptr<DrawingStore>(new DrawingStore(std::move(run), path, files));
}

DrawingStore::DrawingStore(RunFolder run, const CameraPath& path, const DrawnFiles& files)
    : run_(std::move(run)), files_(files),
      with_flow_(files.encoding.flow ? pieces_with_flow(path) : std::set<std::string>()),
      record_(run_, [this](const std::string& piece) { return files_of(piece); })
{
    for (const Json& entry : run_.entries())
        if (files_.boxes && entry.is_object() && entry.value("piece", Json()).is_string() &&
            entry.value(kBoxes, Json()).is_string())
            files_.boxes->keep(entry.value("piece", ""), entry.value(kBoxes, ""));
}

Path DrawingStore::folder(const std::string& camera) const
{
    return camera_folder(run_.path(), camera);
}

std::vector<Path> DrawingStore::files_of(const std::string& piece) const
{
    if (piece == kTop)
        return {run_.path() / kTop};
    const Path name = run_.path() / piece;
    if (std::ranges::count(piece, '/') == 2) // sweep_name()
        return {name.generic_string() + fmt::format(".{}", kLidarEndings[size_t(files_.lidar)])};
    std::vector<Path> files;
    for (const std::string kind : kPictures) {
        const std::string_view extension = kind == "color"   ? files_.encoding.color_extension()
                                           : kind == "depth" ? files_.encoding.depth_extension()
                                                             : "png";
        files.push_back(name.parent_path() / kind / fmt::format("{}.{}", name.filename().string(), extension));
    }
    for (const char* kind : kArrays)
        if (files_.floats)
            files.push_back(name.parent_path() / kind / (name.filename().string() + ".npy"));
    if (files_.instances)
        files.push_back(name.parent_path() / kInstances / (name.filename().string() + ".png"));
    if (with_flow_.contains(piece)) {
        const std::string_view extension = kFlowFormats[size_t(*files_.encoding.flow)];
        files.push_back(name.parent_path() / kFlow / fmt::format("{}.{}", name.filename().string(), extension));
        files.push_back(name.parent_path() / kFlowStates / (name.filename().string() + ".png"));
    }
    return files;
}

bool DrawingStore::has(const std::string& camera, uint32_t number) const
{
    return record_.has(frame_key(camera, number));
}

bool DrawingStore::has_sweep(const std::string& lidar, uint32_t number) const
{
    return record_.has(sweep_name(lidar, number));
}

bool DrawingStore::has_top() const
{
    return record_.has(kTop);
}

Result<bool> DrawingStore::saw_nothing(const std::string& camera, uint32_t number) const
{
    SR_TRY(const DepthPicture depth,
           read_depth_picture(frame_path(folder(camera), "depth", number, files_.encoding.depth_extension()), 1));
    SR_TRY(const ImageRgb8 visible, read_png_rgb8(frame_path(folder(camera), "visible", number)));
    const auto is_zero = [](auto value) { return value == 0; };
    return std::ranges::all_of(depth.pixels, is_zero) && std::ranges::all_of(visible.pixels, is_zero);
}

Result<FileQueue::Commit> DrawingStore::make(const CameraFrame& frame, uint32_t number, const FramePixels& pixels,
                                             const SplatImage* floats)
{
    const auto files = std::make_shared<MadeFiles>();
    SR_CHECK(make_frame_images(folder(frame.camera), number, pixels, files_.encoding, *files));
    if (floats)
        SR_CHECK(make_float_images(folder(frame.camera), number, *floats, *files));
    const std::string piece = frame_key(frame.camera, number);
    if (!files_.boxes)
        return [this, piece, files] { return record_.add(piece, *files); };
    return [this, piece, files, boxes = files_.boxes->line(frame, number, pixels)] {
        files_.boxes->keep(piece, boxes);
        return record_.add(piece, *files, {{kBoxes, boxes}});
    };
}

Result<FileQueue::Commit> DrawingStore::make_sweep(const std::string& lidar, uint32_t number,
                                                   std::span<const LidarPoint> points)
{
    const auto files = std::make_shared<MadeFiles>();
    const std::string piece = sweep_name(lidar, number);
    SR_CHECK(files->add(files_of(piece).front(), encode_lidar(points, files_.lidar)));
    return [this, piece, files] { return record_.add(piece, *files); };
}

Result<FileQueue::Commit> DrawingStore::make_top(const ImageSize& size, std::span<const uint8_t> color)
{
    const auto files = std::make_shared<MadeFiles>();
    SR_TRY(const std::vector<std::byte> png,
           encode_png_rgb8(size.width, size.height, color, files_.encoding.png_level));
    SR_CHECK(files->add(run_.path() / kTop, png));
    return [this, files] { return record_.add(kTop, *files); };
}

Status DrawingStore::write_cameras(const CameraPath& path) const
{
    MadeFiles files;
    for (const LidarSensor& lidar : path.lidars) {
        const std::string text = json_text(sweeps_json(path, lidar.name)) + "\n";
        SR_CHECK(files.add(run_.path() / lidar.name / kSweepsName, std::as_bytes(std::span(text))));
    }
    SR_CHECK(files.commit());
    if (path.frames.empty())
        return {};
    const auto pictures = [this](const std::string& camera, uint32_t number) {
        return rendered_pictures(camera, number, files_.encoding);
    };
    return write_transforms(run_.path() / kCameras, path,
                            {pictures, files_.points ? kPoints : "", files_.encoding.depth_unit()});
}

Status DrawingStore::finish(const Json& results)
{
    if (files_.boxes)
        SR_CHECK(files_.boxes->write(run_.path()));
    return run_.finish(results);
}

Status DrawingStore::restore_boxes() const
{
    if (!files_.boxes)
        return {};
    SR_TRY(const FileType type, examine(run_.path() / kBoxesName));
    return type == FileType::regular ? Status() : files_.boxes->write(run_.path());
}

} // namespace semrover
