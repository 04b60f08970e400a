// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/camera_path.h"
#include "engine/refine/frame_images.h"
#include "engine/scene/grid.h"
#include "engine/splat/rasterizer.h"
#include "tools/cli/lens_options.h"

#include <functional>
#include <map>
#include <optional>
#include <tuple>

namespace CLI {
class App;
}

namespace semrover {

// how a grid is driven through and drawn: what `render` and `refine` share
struct DriveOptions : LensOptions {
    std::string path, rig, background = "0,0,0";
    std::string splat_radius; // empty: not given
    bool equirect = false;    // panoramas of width x width / 2 in place of the path's cameras
    float opacity = 1;
    std::optional<float> visible_alpha; // 0.5, or what a model says
    bool semantic = false;
};
void add_drive_options(CLI::App& command, DriveOptions& options);

// of `--splat-radius` (empty: 0.04) and `--opacity`; usage
Result<SurfelOptions> surfel_options(const std::string& splat_radius, float opacity);
Status check_drive(const DriveOptions& options);                           // usage
Result<std::array<uint8_t, 3>> background_of(const DriveOptions& options); // usage
Result<CameraPath> load_cameras(const DriveOptions& options);              // the path, through the rig if any
uint64_t hash_cameras(const CameraPath& path);
Result<SurfelScene> load_scene(const DriveOptions& options, const Path& grid_path, const VoxelGrid& grid,
                               Device& device);

// frames of one moment are drawn in one submit, with one rasterizer for each image size and camera model
class PathRenderer {
  public:
    PathRenderer(Device& device, const SurfelScene& scene, const RasterizerOptions& options)
        : device_(device), scene_(scene), options_(options)
    {
    }

    Result<std::vector<SplatImage>> render(std::span<const CameraFrame> frames);

  private:
    Device& device_;
    const SurfelScene& scene_;
    RasterizerOptions options_;
    std::map<std::tuple<uint32_t, uint32_t, CameraModel>, std::unique_ptr<Rasterizer>> rasterizers_;
};

// draws a whole path in order; `drawn` gets every frame, `moved` how many there were after each moment and may stop the
// run. The pictures of a camera without a name belong into the folder itself.
struct PathCallbacks {
    std::function<Status(const CameraFrame&, const SplatImage&)> drawn;
    std::function<Status(size_t done)> moved;
};
Status render_path(PathRenderer& renderer, const CameraPath& path, const PathCallbacks& callbacks);
Path camera_folder(const Path& folder, const std::string& camera);

} // namespace semrover
