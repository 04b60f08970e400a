// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/scene_grid.h"

namespace semrover {

// SemanticKITTI's voxels: a box of 256 x 256 x 32 voxels of 0.2 m in the lidar's frame (x forward, y left, z up), 0 to
// 51.2, -25.6 to 25.6 and -2 to 4.4 m; voxel (x, y, z) is entry (x * 256 + y) * 32 + z. NNNNNN.label has a raw label
// (uint16, little endian, semantic-kitti.yaml's numbers) an entry, 0 where nothing is; NNNNNN.bin and NNNNNN.invalid a
// bit an entry, the most significant bit first: what one scan hit, and what no scan could see.
// The grid's world frame is the lidar's, so a 0.6 m cell is exactly 3 x 3 x 3 voxels (resample() in dense_labels.h).
// Source: https://github.com/PRBonn/semantic-kitti-api, config/semantic-kitti.yaml and README.md

// `path` is a .label, or a .bin with its .label beside it: then only voxels that the .bin has count. Voxels of an
// .invalid beside it never count. bad_input for a file of another size, and unknown labels (listed with counts).
Result<SceneGrid> read_semantic_kitti(const Path& path, const SceneGridOptions& options);

// NNNNNN.label and NNNNNN.bin, whichever of the two `path` names. Cells are split; what sticks out of the box is cut
// off. bad_input when whole cells are outside, or a cell is not a whole number of voxels. Classes that SemanticKITTI
// has not: traffic lights become traffic signs, sky is left out; `warnings` says how many.
Status write_semantic_kitti(const Path& path, const VoxelGrid& grid, std::vector<std::string>& warnings);

} // namespace semrover
