// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/ply.h"

#include <array>
#include <string>
#include <vector>

namespace semrover {

// splats of a file as flat ones
struct SplatFile {
    Splats splats;
    std::vector<std::string> warnings; // a line each
    uint64_t dropped = 0;
};

// a 3D Gaussian as files have it
struct Ellipsoid {
    std::array<double, 3> position{}; // metres
    std::array<double, 3> scale{};    // metres, standard deviations along its own axes
    std::array<double, 4> rotation{}; // x, y, z, w: from its axes to the world's; of any length but 0
    std::array<double, 3> color{};    // sRGB, 0..1
    double opacity = 0;               // 0..1
    uint8_t label = kNoLabel;
};

// Makes splats of ellipsoids: the axis of the smallest scale (of equal ones the last) is the normal. The tangents of a
// splat follow from its normal (tangents_of), so the variances along them are kept, and the correlation between them
// is lost: splats that are longer than wide and lie across the tangents are counted. So are thick ones (third scale
// above half the second). Splats that are not finite, or without a rotation or a size, are dropped and counted.
class EllipsoidFlattener {
  public:
    explicit EllipsoidFlattener(std::string where) : where_(std::move(where)) {}

    void add(const Ellipsoid& ellipsoid, bool flat = false); // flat: the third axis is the normal, whatever its scale
    void count_view_dependent() { ++view_dependent_; }       // a splat with harmonics above degree 0, which are lost
    Result<SplatFile> finish() &&;                           // bad_input when nothing is left

  private:
    std::string where_;
    SplatFile out_;
    uint64_t not_finite_ = 0, without_size_ = 0, across_ = 0, thick_ = 0, view_dependent_ = 0;
};

// 3DGS or 2DGS, by property name in any order, ascii or binary: x y z, scale_0 scale_1 (scale_2) as logarithms,
// rot_0..3 (w first), opacity as a logit, f_dc_0..2 or red green blue, an integer label if there (one that is no class
// of ours is left out, with a warning). Without scale_2 the splats are flat (2DGS). bad_input for files without these
Result<SplatFile> read_splats_ply(const Path& path);

// In the axes that viewers of .ply and .splat expect: y down, x and z so that half a turn about z, which they apply,
// shows what a .glb of the same scene shows. (x, y, z) of the world becomes (y, -z, -x).
// Source: PlayCanvas' splat-transform, Transform.PLY
Splats turned_for_viewers(const Splats& splats);

// antimatter15's .splat: 32 bytes a splat: position 3 f32, scale 3 f32 in metres, RGBA u8, quaternion u8 (w first,
// 128 q + 128). Source: https://github.com/antimatter15/splat, README.md and convert.py
Result<SplatFile> read_dot_splat(const Path& path);
Status write_dot_splat(const Path& path, const Splats& splats);

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
