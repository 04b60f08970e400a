// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/splat_file.h"

namespace semrover {

// Splats in a binary glTF file by KHR_gaussian_splatting: points with POSITION and KHR_gaussian_splatting:ROTATION
// (x, y, z, w), :SCALE (metres, linear), :OPACITY, :SH_DEGREE_0_COEF_0, and COLOR_0 (linear) for readers that know no
// splats. glTF is y up: (x, y, z) of the file is (-y, z, -x) of the world.
// Source: https://github.com/KhronosGroup/glTF, extensions/2.0/Khronos/KHR_gaussian_splatting

// the splats of all points in the scene. Components may be quantised. bad_input for a file without splats, transforms
// that are not rigid but for one scale, and negative scales (an early draft stored logarithms: convert such files with
// the program that wrote them). _LABEL, our addition, is a class.
Result<SplatFile> read_splats_glb(const Path& path);

// kernel ellipse, colour space srgb_rec709_display, a third scale of 1e-4 m; the same splats give the same bytes;
// atomic
Status write_splats_glb(const Path& path, const Splats& splats);

} // namespace semrover
