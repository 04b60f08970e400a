// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "tools/commands/scene_input.h"

#include "runtime/base/json.h"

namespace semrover {

using Report = nlohmann::ordered_json;

Report metres(const Point3& position); // to a tenth of a millimetre

// frames, cameras, what the poses are of, times, where the cameras are
Report describe_path(const Path& name, const CameraPath& path);

// how many frames are in a scene, near it and look at it, and what to try where none does
Report describe_meeting(const Path& name, const CameraPath& path, const SceneInput& scene);

} // namespace semrover
