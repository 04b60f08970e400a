// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/commands/scene_input.h"
#include "tools/dataset/object_boxes.h"

namespace semrover {

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

} // namespace semrover
