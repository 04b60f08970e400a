// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"
#include "engine/scene/palette.h"

#include <array>
#include <span>

namespace semrover {

// How far borders of labels lie from edges of a picture. A border is between two pixels of a row or a column that have
// different classes. Its edge is the largest step of luma (0.299 R + 0.587 G + 0.114 B) between neighbours on this row
// or column, at most kEdgeReach pixels away; of equal ones the nearest.
constexpr int kEdgeReach = 8;
constexpr double kLeastStep = 8; // of 255; smaller ones are no edge

struct EdgeDistances {
    uint64_t borders = 0;                           // that have kEdgeReach pixels on both sides
    std::array<uint64_t, kEdgeReach + 1> at_most{}; // borders with an edge this many pixels away or nearer
    double step = 0, step_beside = 0;               // sums: at the border; the mean of all that are in reach

    EdgeDistances& operator+=(const EdgeDistances& other);
};

struct EdgeAgreement {
    EdgeDistances all;
    std::array<EdgeDistances, kClassCount> labels; // of either side

    EdgeAgreement& operator+=(const EdgeAgreement& other);
};

// labels: [height, width], a class or anything else, whose borders are not looked at
EdgeAgreement edge_agreement(const ImageRgb8& frame, std::span<const uint8_t> labels);

} // namespace semrover
