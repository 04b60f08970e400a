// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tests/support/kernel_case.h"

namespace semrover {

// images on the host in the device's layout: NHWC, the rows of an image padded
struct HostImages {
    uint32_t height = 0, width = 0;
    HostMatrix rows;

    uint32_t image_rows() const { return round_up(height * width, kImageRowPadding); }
    uint32_t batch() const { return rows.rows / image_rows(); }
    float at(uint32_t image, uint32_t y, uint32_t x, uint32_t channel) const
    {
        return rows.at(image * image_rows() + y * width + x, channel);
    }
    FeatureMap input(KernelCase& k) const { return {k.input(rows), batch(), height, width}; }
};

// padding rows hold large numbers, on which nothing may depend
inline HostImages random_images(KernelCase& k, uint32_t batch, uint32_t height, uint32_t width, uint32_t channels,
                                DType dtype, float scale = 1)
{
    HostImages m{height, width, {}};
    m.rows = k.random(batch * m.image_rows(), channels, dtype, scale);
    for (uint32_t r = 0; r < m.rows.rows; ++r)
        for (uint32_t c = 0; c < channels && r % m.image_rows() >= height * width; ++c)
            m.rows.set(r, c, 1000.f);
    return m;
}

} // namespace semrover
