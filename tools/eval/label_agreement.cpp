// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/label_agreement.h"

#include "runtime/base/result.h"

#include <algorithm>
#include <numeric>

namespace semrover {

LabelAgreement& LabelAgreement::operator+=(const LabelAgreement& other)
{
    for (size_t t = 0; t < kClassCount; ++t)
        for (size_t s = 0; s <= kClassCount; ++s)
            pixels[t][s] += other.pixels[t][s];
    unlabelled += other.unlabelled;
    return *this;
}

uint64_t LabelAgreement::counted() const
{
    uint64_t sum = 0;
    for (size_t t = 0; t < kClassCount; ++t)
        sum += of_truth(t);
    return sum;
}

uint64_t LabelAgreement::of_truth(size_t label) const
{
    return std::accumulate(pixels[label].begin(), pixels[label].end(), uint64_t(0));
}

uint64_t LabelAgreement::shown(size_t label) const
{
    uint64_t sum = 0;
    for (const auto& of_true : pixels)
        sum += of_true[label];
    return sum;
}

double LabelAgreement::accuracy() const
{
    uint64_t equal = 0;
    for (size_t t = 0; t < kClassCount; ++t)
        equal += pixels[t][t];
    return double(equal) / double(counted());
}

std::optional<double> LabelAgreement::iou(size_t label) const
{
    const uint64_t both = pixels[label][label], either = of_truth(label) + shown(label) - both;
    return either ? std::optional(double(both) / double(either)) : std::nullopt;
}

double LabelAgreement::mean_iou() const
{
    double sum = 0;
    for (size_t t = 0; t < kClassCount; ++t)
        sum += iou(t).value_or(0);
    return sum / double(classes());
}

size_t LabelAgreement::classes() const
{
    size_t count = 0;
    for (size_t t = 0; t < kClassCount; ++t)
        count += iou(t).has_value();
    return count;
}

LabelAgreement label_agreement(std::span<const uint8_t> frame, std::span<const uint8_t> truth)
{
    SR_ASSERT(frame.size() == truth.size(), "labels of {} and {} pixels", frame.size(), truth.size());
    LabelAgreement y;
    for (size_t i = 0; i < truth.size(); ++i)
        if (truth[i] < kClassCount)
            ++y.pixels[truth[i]][std::min<size_t>(frame[i], kClassCount)];
        else
            ++y.unlabelled;
    return y;
}

} // namespace semrover
