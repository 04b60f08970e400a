// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace semrover::view {

class Viewer;

// The panels over the picture: figures, what is shown, the picked voxel, brush, path, refinement. Between the beginning
// and the end of the overlay's frame
void draw_panels(Viewer& viewer);

} // namespace semrover::view
