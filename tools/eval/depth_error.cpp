// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/depth_error.h"

#include "runtime/base/result.h"

#include <algorithm>
#include <cmath>

namespace semrover {

DepthErrors& DepthErrors::operator+=(const DepthErrors& other)
{
    truth += other.truth;
    pixels += other.pixels;
    relative += other.relative;
    relative_squares += other.relative_squares;
    squares += other.squares;
    log_squares += other.log_squares;
    for (size_t i = 0; i < within.size(); ++i)
        within[i] += other.within[i];
    return *this;
}

double DepthErrors::share() const
{
    return truth ? double(pixels) / double(truth) : 0;
}

std::array<double, 7> DepthErrors::figures() const
{
    const auto n = double(pixels);
    return {relative / n,          relative_squares / n,  std::sqrt(squares / n), std::sqrt(log_squares / n),
            double(within[0]) / n, double(within[1]) / n, double(within[2]) / n};
}

DepthErrors depth_errors(std::span<const float> frame, std::span<const float> truth, double most)
{
    SR_ASSERT(frame.size() == truth.size(), "depths of {} and {} pixels", frame.size(), truth.size());
    DepthErrors y;
    for (size_t i = 0; i < truth.size(); ++i) {
        const double t = truth[i], d = std::min(double(frame[i]), most);
        if (t <= 0 || t > most)
            continue;
        ++y.truth;
        if (d <= 0)
            continue;
        ++y.pixels;
        const double error = d - t, log = std::log(d / t);
        y.relative += std::abs(error) / t;
        y.relative_squares += error * error / t;
        y.squares += error * error;
        y.log_squares += log * log;
        const double ratio = std::max(d / t, t / d);
        for (size_t k = 0; k < y.within.size(); ++k)
            y.within[k] += ratio < std::pow(1.25, double(k + 1));
    }
    return y;
}

} // namespace semrover
