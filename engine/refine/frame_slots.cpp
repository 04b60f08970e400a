// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/frame_slots.h"

namespace semrover {

namespace {

Slot frame_of(const Slot& slot, uint32_t frames, uint32_t number)
{
    const uint32_t rows = slot.rows() / frames;
    return slot.row_range(number * rows, rows);
}

} // namespace

Status write_frames(Device& device, const Slot& slot, uint32_t frames, std::span<const float> values)
{
    const size_t size = values.size() / frames;
    SR_ASSERT(values.size() == frames * size && size % slot.cols() == 0, "{} numbers for {} frames of '{}'",
              values.size(), frames, slot.name());
    for (uint32_t f = 0; f < frames; ++f)
        SR_CHECK(frame_of(slot, frames, f).write_rows(device, values.subspan(f * size, size)));
    return {};
}

Result<std::vector<float>> read_frames(Device& device, const Slot& slot, uint32_t frames, uint32_t pixels)
{
    std::vector<float> values;
    values.reserve(size_t(frames) * pixels * slot.cols());
    for (uint32_t f = 0; f < frames; ++f) {
        SR_TRY(const auto frame, frame_of(slot, frames, f).read_rows(device, pixels));
        values.insert(values.end(), frame.begin(), frame.end());
    }
    return values;
}

} // namespace semrover
