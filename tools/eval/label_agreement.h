// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/palette.h"

#include <array>
#include <optional>
#include <span>

namespace semrover {

// Which classes pixels show where the truth has which: counts, so that frames can be pooled. Intersection over union is
// Cityscapes' (Cordts et al. 2016, arXiv 1604.01685): TP / (TP + FP + FN), over all pixels whose truth is a class.
struct LabelAgreement {
    // [true class][shown class; the last: none]
    std::array<std::array<uint64_t, kClassCount + 1>, kClassCount> pixels{};
    uint64_t unlabelled = 0; // pixels whose truth is no class: they do not count

    LabelAgreement& operator+=(const LabelAgreement& other);
    uint64_t counted() const;
    uint64_t of_truth(size_t label) const;
    uint64_t shown(size_t label) const; // among those that count
    double accuracy() const;            // share of those that count with the true class; of one pixel or more
    std::optional<double> iou(size_t label) const; // none of a class that is in neither
    double mean_iou() const;                       // over the classes that have one; of one pixel or more
    size_t classes() const;                        // that have one
};

// labels [height, width]: a class, or anything else for none
LabelAgreement label_agreement(std::span<const uint8_t> frame, std::span<const uint8_t> truth);

} // namespace semrover
