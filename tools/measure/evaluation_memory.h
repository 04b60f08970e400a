// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/device.h"

#include <vector>

namespace semrover {

// arrays of one evaluation in device memory
class EvaluationMemory {
  public:
    template <typename T>
    uint32_t add(const std::vector<T>& values)
    {
        const auto* bytes = reinterpret_cast<const std::byte*>(values.data());
        contents_.emplace_back(bytes, bytes + values.size() * sizeof(T));
        return arena_.add(contents_.back().size());
    }
    uint32_t add_empty(uint64_t bytes)
    {
        contents_.emplace_back();
        return arena_.add(bytes);
    }
    Status upload(Device& device)
    {
        SR_CHECK(arena_.allocate(device, "golden case"));
        for (uint32_t i = 0; i < contents_.size(); ++i)
            SR_CHECK(device.write(arena_.slice(i), contents_[i]));
        return {};
    }
    BufferSlice slice(uint32_t id) const { return arena_.slice(id); }

  private:
    Arena arena_;
    std::vector<std::vector<std::byte>> contents_;
};

} // namespace semrover
