// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/depth_picture.h"
#include "engine/format/flow_picture.h"
#include "engine/scene/palette.h"
#include "tools/eval/flicker.h"

#include <array>
#include <map>

namespace semrover {

// by how much two depths may differ where both show one surface
struct SurfaceTolerance {
    double metres = 0.05, relative = 0.01;
};

// pixels of a picture of things against the true one
struct ThingAgreement {
    struct Counts {
        uint64_t pixels = 0; // with a true depth
        uint64_t shared = 0; // of these, where both show one surface
        uint64_t equal = 0;  // of these, with the true number

        double share() const { return shared ? double(equal) / double(shared) : 1; }
    };
    Counts all;
    std::array<Counts, kClassCount + 1> labels;                      // by true class; the last: of none
    std::map<std::pair<uint16_t, uint16_t>, uint64_t> mistaken = {}; // true number and the other: pixels

    ThingAgreement& operator+=(const ThingAgreement& other);
};

struct ThingPicture {
    DepthPicture depth;
    std::vector<uint16_t> things; // [height, width] numbers, 0: none
};

// whether a pixel has depths in both, which are of one surface
bool one_surface(const ThingPicture& picture, const ThingPicture& truth, size_t pixel, const SurfaceTolerance& o);

// of pictures of one size; labels: true classes, [height, width]
ThingAgreement thing_agreement(const ThingPicture& picture, const ThingPicture& truth, std::span<const uint8_t> labels,
                               const SurfaceTolerance& o);

// how far optical flow is from the true one, pixels: where it is known, the true point is seen in the next picture, and
// both pictures show one surface
struct FlowErrors {
    std::vector<float> standing = {}, moving = {}; // of pixels of what moves besides the camera
    uint64_t seen = 0;                             // pixels whose true point is seen in the next picture

    FlowErrors& operator+=(const FlowErrors& other);
};
// truth: from the true depths of both frames (flow_between, whose `to` is now and whose `from` is next)
FlowErrors flow_errors(const FlowPicture& flow, const Flow& truth, const ThingPicture& picture,
                       const ThingPicture& true_picture, const ThingMotions& motions, const SurfaceTolerance& o);

// the value that a share (0..1) of the values do not exceed; of an empty list 0. Reorders them
float quantile(std::vector<float>& values, double share);

} // namespace semrover
