// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"

#include <map>
#include <string>
#include <vector>

namespace semrover {

// what COLMAP's text and binary models share

// Parameters are f or fx fy, cx cy, then the coefficients; of panoramas the image's size again.
// Source: https://colmap.github.io/cameras.html, and src/colmap/sensor/models of its sources for the numbers
struct ColmapModel {
    uint32_t id; // in binary files
    const char* name;
    CameraModel model;
    uint32_t focals;                   // 1: one focal length for both axes; 0: the image's size again
    std::vector<uint8_t> coefficients; // where each further parameter goes in Intrinsics::distortion; 255: see below
    size_t parameters() const { return focals ? focals + 2 + coefficients.size() : 2; }
};

// null when it is not known
const ColmapModel* colmap_model_of_name(std::string_view name);
const ColmapModel* colmap_model_of_id(uint32_t id);
std::string colmap_model_names(); // with commas between
const ColmapModel& colmap_model_for(const Intrinsics& intrinsics);

// width, height and the parameters, as many as the model has. A FOV lens becomes the fisheye whose polynomial follows
// it within kMaxFovError everywhere in the image; THIN_PRISM_FISHEYE is a fisheye where its p1, p2, sx1 and sy1 are 0.
// bad_input for other values of these, and for what check_intrinsics refuses
constexpr double kMaxFovError = 0.05; // pixels
Result<Intrinsics> colmap_intrinsics(const ColmapModel& model, const std::vector<double>& values,
                                     std::string_view where);

struct ColmapPicture {
    std::string name; // of its file, with folders
    CameraFrame frame;
};
// from w x y z and the translation, world to camera
Result<ColmapPicture> colmap_picture(const std::array<double, 4>& rotation, const std::array<double, 3>& translation,
                                     const Intrinsics& intrinsics, std::string name, std::string_view where);

// cameras.bin and images.bin of a folder
Result<std::vector<ColmapPicture>> read_colmap_binary(const Path& folder);

} // namespace semrover
