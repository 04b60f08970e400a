// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/checkpoint.h"

#include <gtest/gtest.h>

namespace semrover {

inline std::vector<float> values_of(const Checkpoint& checkpoint, const TensorSpec& spec)
{
    std::vector<float> scratch;
    const auto values = checkpoint.values(spec, scratch);
    EXPECT_TRUE(values) << values.error().message;
    std::vector<float> numbers(values->bytes.size() / dtype_bytes(values->dtype));
    to_float(values->bytes, values->dtype, numbers.data());
    return numbers;
}

} // namespace semrover
