// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/format/depth_picture.h"

namespace semrover {

enum class DepthKind : uint8_t {
    z,    // along the optical axis
    ray,  // from the camera: Hypersim, Unreal, Blender
    carla // along the axis, in 24 bits: R + 256 G + 65536 B, (2^24 - 1) of them are 1000 m
};

struct DepthEncoding {
    std::optional<DepthKind> kind; // none: carla for pictures in 8-bit colour, else z
    std::optional<double> unit;    // metres of one unit; none: as below of whole numbers, 1 of fractions
    double usual_unit = kMillimetre;
};

struct DepthImage {
    ImageSize size;
    std::vector<float> metres; // [height, width]; 0: nothing
    DepthKind kind = DepthKind::z;
};

// A PNG of 16-bit gray (0 and 65535: nothing), CARLA's PNG, or an array (number_image.h) of metres in fractions (not
// finite, 0 or less: nothing) or of whole numbers, as the PNG. Errors: bad_input
Result<DepthImage> read_depth_image(const Path& path, const DepthEncoding& encoding = {});

// depth along the axis of what is along each pixel's ray, through a pinhole
void make_axial(DepthImage& depth, const Intrinsics& pinhole);

} // namespace semrover
