// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"

#include <cstdint>
#include <cstring>
#include <gtest/gtest.h>
#include <string>
#include <vector>

namespace semrover {

// a golden case as stored: its params and its tensors by name. For trusted files only; the product reads safetensors
// with runtime/base/safetensors.h, which this leaves out so that a fault there cannot hide one here.
struct GoldenTensors {
    nlohmann::json params;
    nlohmann::json header;
    std::string data;

    explicit GoldenTensors(const std::string& name);

    template <typename T>
    std::vector<T> get(const std::string& tensor) const
    {
        const auto& entry = header.at(tensor);
        const std::string dtype = entry.at("dtype");
        const char* expected = sizeof(T) == 1 ? "U8" : std::is_floating_point_v<T> ? "F32" : "I32";
        EXPECT_EQ(dtype, expected) << tensor;
        const size_t begin = entry.at("data_offsets").at(0), end = entry.at("data_offsets").at(1);
        std::vector<T> values((end - begin) / sizeof(T));
        if (end > begin)
            std::memcpy(values.data(), data.data() + begin, end - begin);
        return values;
    }
};

} // namespace semrover
