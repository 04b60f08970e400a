// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/splat/surfels.h"

namespace semrover {

// A semantic grid drawn as blocks: 5 x 5 surfels on every face of a cell that borders an empty cell, in label colours,
// large enough to leave no hole.
SurfelPoints block_points(const VoxelGrid& grid);

// colours become those of the labels
void color_by_label(SurfelPoints& points);

} // namespace semrover
