// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/camera/image_size.h"
#include "engine/deferred/frame_images.h"
#include "engine/format/lidar_points.h"
#include "engine/job/file_queue.h"
#include "engine/job/frame_boxes.h"
#include "engine/job/piece_record.h"

#include <set>

namespace semrover {

// what a drawing writes, beside the path's pictures
struct DrawnFiles {
    // {depth_expected,depth_median,alpha}/000000.npy of float32, [height, width]: depths are metres, measured as
    // SplatCamera::radial_depth says, 0 where nothing is drawn (docs/formats.md §6)
    bool floats = false;
    bool top = false;            // top.png
    bool points = false;         // points.ply
    bool instances = false;      // instance/000000.png
    FrameBoxes* boxes = nullptr; // boxes.jsonl and objects.json, of lines that it keeps; outlives the drawing
    PictureEncoding encoding = {};
    LidarFormat lidar = LidarFormat::npy; // of LIDAR/points/000000.npy, .. of sweeps
};

// The pictures of a drawing in its folder, and which of them are done. A piece is a frame, with all its files.
class DrawingStore {
  public:
    // usage for what is there and is not of a drawing that may go on
    static Status check(const Path& folder, const CameraPath& path, bool replace);

    // The run with these settings; what is of no use for it is removed. `floats`, `top` and `points` are settings.
    static Result<std::unique_ptr<DrawingStore>> open(const Path& folder, const Json& settings, const CameraPath& path,
                                                      const DrawnFiles& files, bool replace);

    const RunFolder& run() const { return run_; }
    Path folder(const std::string& camera) const; // of its pictures
    bool has(const std::string& camera, uint32_t number) const;
    bool has_top() const;
    bool has_sweep(const std::string& lidar, uint32_t number) const;
    // whether the pictures of a frame that is there show nothing of the scene
    Result<bool> saw_nothing(const std::string& camera, uint32_t number) const;
    // On any thread; what they return is called on another one than has(), or after the last call of it.
    // number: of the frame among its camera's; floats: of the frame, where DrawnFiles has them
    Result<FileQueue::Commit> make(const CameraFrame& frame, uint32_t number, const FramePixels& pixels,
                                   const SplatImage* floats);
    Result<FileQueue::Commit> make_sweep(const std::string& lidar, uint32_t number, std::span<const LidarPoint> points);
    Result<FileQueue::Commit> make_top(const ImageSize& size, std::span<const uint8_t> color);
    // transforms.json of the path's frames, LIDAR/sweeps.json of its sweeps
    Status write_cameras(const CameraPath& path) const;
    Status finish(const Json& results); // with the boxes, where they are asked for
    // a finished drawing's boxes that are not there any more
    Status restore_boxes() const;
    void drop_if_empty() { run_.drop_if_empty(); }

  private:
    DrawingStore(RunFolder run, const CameraPath& path, const DrawnFiles& files);
    std::vector<Path> files_of(const std::string& piece) const;

    RunFolder run_;
    DrawnFiles files_;
    std::set<std::string> with_flow_; // pieces
    PieceRecord record_;
};

} // namespace semrover
