// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/thing_agreement.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr float kLeastUnknown = 1e9f; // of optical flow (engine/format/flow_picture.h)

void add(ThingAgreement::Counts& to, const ThingAgreement::Counts& other)
{
    to.pixels += other.pixels;
    to.shared += other.shared;
    to.equal += other.equal;
}

} // namespace

ThingAgreement& ThingAgreement::operator+=(const ThingAgreement& other)
{
    add(all, other.all);
    for (size_t i = 0; i < labels.size(); ++i)
        add(labels[i], other.labels[i]);
    for (const auto& [pair, pixels] : other.mistaken)
        mistaken[pair] += pixels;
    return *this;
}

bool one_surface(const ThingPicture& picture, const ThingPicture& truth, size_t pixel, const SurfaceTolerance& o)
{
    const double a = picture.depth.pixels[pixel] * picture.depth.unit, b = truth.depth.pixels[pixel] * truth.depth.unit;
    return a > 0 && b > 0 && std::abs(a - b) <= o.metres + o.relative * b;
}

ThingAgreement thing_agreement(const ThingPicture& picture, const ThingPicture& truth, std::span<const uint8_t> labels,
                               const SurfaceTolerance& o)
{
    ThingAgreement y;
    for (size_t i = 0; i < truth.things.size(); ++i) {
        if (truth.depth.pixels[i] == 0)
            continue;
        const bool shared = one_surface(picture, truth, i, o), equal = shared && picture.things[i] == truth.things[i];
        const ThingAgreement::Counts one{1, shared, equal};
        add(y.all, one);
        add(y.labels[std::min<size_t>(labels[i], kClassCount)], one);
        if (shared && !equal)
            ++y.mistaken[{truth.things[i], picture.things[i]}];
    }
    return y;
}

FlowErrors& FlowErrors::operator+=(const FlowErrors& other)
{
    standing.insert(standing.end(), other.standing.begin(), other.standing.end());
    moving.insert(moving.end(), other.moving.begin(), other.moving.end());
    seen += other.seen;
    return *this;
}

FlowErrors flow_errors(const FlowPicture& flow, const Flow& truth, const ThingPicture& picture,
                       const ThingPicture& true_picture, const ThingMotions& motions, const SurfaceTolerance& o)
{
    FlowErrors errors;
    for (size_t i = 0; i < truth.sources.size(); ++i) {
        const Flow::Source& to = truth.sources[i];
        if (!to.valid())
            continue;
        ++errors.seen;
        const float u = flow.flow[2 * i], v = flow.flow[2 * i + 1];
        if (u >= kLeastUnknown || v >= kLeastUnknown || !one_surface(picture, true_picture, i, o))
            continue;
        const double x = to.x - double(i % flow.width) - 0.5, y = to.y - double(i / flow.width) - 0.5;
        const bool moves = motions.motions.contains(true_picture.things[i]);
        (moves ? errors.moving : errors.standing).push_back(float(std::hypot(double(u) - x, double(v) - y)));
    }
    return errors;
}

float quantile(std::vector<float>& values, double share)
{
    if (values.empty())
        return 0;
    const auto at = values.begin() + std::lround(share * double(values.size() - 1));
    std::ranges::nth_element(values, at);
    return *at;
}

} // namespace semrover
