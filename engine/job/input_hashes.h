// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/path_drawing.h"
#include "runtime/base/json.h"

namespace semrover {

// What runs are known by, beside files: what was read, whatever files and options it came from.
uint64_t hash_grid(const VoxelGrid& grid);
uint64_t hash_splats(const Splats& splats);
uint64_t hash_cameras(const CameraPath& path);

// what of DrawOptions decides pictures
Json drawing_json(const DrawOptions& options);

// what of it decides the bytes of pictures and is not as usual
Json encoding_json(const PictureEncoding& encoding);

} // namespace semrover
