// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>

namespace semrover {

// RMSE and sq_rel are in metres, the deltas shares, 0..1
constexpr std::array<const char*, 7> kDepthFigures = {"abs_rel", "sq_rel", "rmse",  "rmse_log",
                                                      "delta1",  "delta2", "delta3"};

// How far depth is from the true one: sums, so that frames can be pooled. Figures are those of Eigen, Puhrsch and
// Fergus 2014 (arXiv 1406.2283), as KITTI's depth prediction and monodepth have them; d is a frame's depth, t the true
// one.
struct DepthErrors {
    uint64_t truth = 0;               // pixels with a true depth that counts
    uint64_t pixels = 0;              // of these, with a depth in the frame, too: figures are of them
    double relative = 0;              // |d - t| / t
    double relative_squares = 0;      // (d - t)^2 / t, metres
    double squares = 0;               // (d - t)^2, square metres
    double log_squares = 0;           // (ln d - ln t)^2
    std::array<uint64_t, 3> within{}; // pixels with max(d / t, t / d) < 1.25, 1.25^2, 1.25^3

    DepthErrors& operator+=(const DepthErrors& other);
    double share() const; // of pixels with a true depth
    // in the order of kDepthFigures, of one pixel or more
    std::array<double, 7> figures() const;
};

// Of depths [height, width] in metres, 0 where there is none. True depths beyond `most` metres do not count; a frame's
// are cut to it, as monodepth does.
DepthErrors depth_errors(std::span<const float> frame, std::span<const float> truth,
                         double most = std::numeric_limits<double>::infinity());

} // namespace semrover
