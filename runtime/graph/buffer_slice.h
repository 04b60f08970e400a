// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace semrover {

class Buffer;

// memory that outlives the graph: weights, inputs, outputs, state kept from one run to the next
struct BufferSlice {
    const Buffer* buffer = nullptr;
    uint64_t offset = 0;
    uint64_t bytes = 0;

    BufferSlice part(uint64_t at, uint64_t count) const { return {buffer, offset + at, count}; }
};

} // namespace semrover
