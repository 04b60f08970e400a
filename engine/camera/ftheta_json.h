// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "runtime/base/json.h"

namespace semrover {

// An f-theta lens under the names and conventions of NVIDIA's NCore (FThetaCameraModelParameters) and AlpaSim
// (FthetaCameraParam):
//   "principal_point": [x, y],           pixels from the centre of the first one
//   "reference_poly": "PIXELDIST_TO_ANGLE" | "ANGLE_TO_PIXELDIST",
//   "pixeldist_to_angle_poly" and "angle_to_pixeldist_poly": of the one that is named up to 6 numbers by rising powers,
//                                        the first 0; pixels and radians. The other may be left out and is not used
//   "max_angle": radians,                the lens ends there
//   "linear_cde": [c, d, e]              default 1, 0, 0
constexpr std::string_view kFthetaKeys[] = {"principal_point",         "reference_poly", "pixeldist_to_angle_poly",
                                            "angle_to_pixeldist_poly", "max_angle",      "linear_cde"};

// into intrinsics of a size; bad_input with `where` in front. check_intrinsics is left to do
Status read_ftheta(const Json& json, Intrinsics& intrinsics, std::string_view where);

// what a picture was scaled by goes into the polynomial and linear_cde
template <typename Object>
void put_ftheta(Object& object, const Intrinsics& k)
{
    const Distortion& p = k.distortion;
    const bool backward = p[9] != 0;
    std::array<double, 6> polynomial{};
    double factor = backward ? 1 : k.fy;
    for (size_t i = 1; i < 6; ++i) {
        factor = backward ? factor / k.fy : factor;
        polynomial[i] = p[i - 1] * factor;
    }
    const double ratio = k.fx / k.fy;
    object["principal_point"] = {k.cx - 0.5, k.cy - 0.5};
    object["reference_poly"] = backward ? "PIXELDIST_TO_ANGLE" : "ANGLE_TO_PIXELDIST";
    object[backward ? "pixeldist_to_angle_poly" : "angle_to_pixeldist_poly"] = polynomial;
    object["max_angle"] = p[8];
    object["linear_cde"] = {p[5] * ratio, p[6] * ratio, p[7]};
}

} // namespace semrover
