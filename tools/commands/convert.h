// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"
#include "tools/cli/camera_options.h"
#include "tools/cli/commands.h"
#include "tools/commands/scene_input.h"
#include "tools/dataset/object_boxes.h"

namespace semrover {

// a scene in another format: grids to grids and splats, splats to splats and points
struct ConvertSceneOptions {
    std::string in, out, to;
    std::string up; // "y": of splats in .ply and .splat, as their viewers expect it; else the world's axes
    SceneInputOptions input;
    std::string splat_radius = "0.04";
    float opacity = 1;
    bool splat_labels = false, dry_run = false;
};
Status convert_scene(const ConvertSceneOptions& options, const Globals& globals);

// a model in the diffusers layout, from a single-file LDM checkpoint or from another folder, with weights of another
// precision or with a deferred renderer's input channels: asd_init for one of images, vsd_init for one of videos
struct ConvertModelOptions {
    std::string in, out, dtype, weights; // weights: "q8_0", or as they are
    bool asd_init = false, vsd_init = false, dry_run = false;
};
// whether a file or folder has weights of a network, or says that it does
bool is_model(const Path& path);

Status convert_model(const ConvertModelOptions& options, const Globals& globals);

// boxes of another program to a file of objects (docs/formats.md §3.1)
struct ConvertObjectsOptions {
    std::string calibration, sample;
    std::optional<uint64_t> frame;
    bool vehicle_frame = false;
};
void add_box_options(CLI::App& command, ConvertObjectsOptions& options);

struct ObjectsInput {
    std::string in, out, map;
    Point3 origin{};
    bool dry_run = false;
};
// errors: usage; bad_input, and then nothing was written
Status convert_objects(const ObjectsInput& input, BoxFormat format, const ConvertObjectsOptions& options,
                       const Globals& globals);

// Objects guessed from the labels of a grid (docs/method.md §2.2), with the usual objects of a model and scene.seed.
// Errors: usage; bad_input, and then nothing was written
Status guess_objects_of(const ObjectsInput& input, const SceneInputOptions& scene, const std::string& model_folder,
                        const Globals& globals);

// trajectories of any format that is read to TUM, KITTI, nerfstudio's two and COLMAP's text model
struct ConvertPathOptions {
    PathOptions placement;
    LensOptions lens;   // where the path has none
    std::string format; // of the result; empty: by its name
    std::string camera; // only this one's frames
    std::string rig;    // every sensor at every pose
    std::string points; // a grid, whose points go along
    std::string images; // a folder of `render` or `refine`, whose pictures go along
};
void add_path_options(CLI::App& command, ConvertPathOptions& options);

// is this a trajectory, and not a scene or a model? By what it holds, and of a file that is not there by its name
Result<bool> is_camera_path(const Path& path);

// bad_input, for what is no path, no scene and no model: what it looks like, and what was expected
Status refuse_unknown_input(const Path& path);

// errors: usage; bad_input, and then nothing was written
Status convert_path(const Path& in, const Path& out, const ConvertPathOptions& options, bool dry_run,
                    const Globals& globals);

} // namespace semrover
