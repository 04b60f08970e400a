// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/state.h"

// Slots that hold the frames of a video: images one after the other, each padded to kImageRowPadding rows.
namespace semrover {

// values: [frames, pixels, columns of the slot]
Status write_frames(Device& device, const Slot& slot, uint32_t frames, std::span<const float> values);
// -> [frames, pixels, columns of the slot]; pixels: of a frame, the first ones
Result<std::vector<float>> read_frames(Device& device, const Slot& slot, uint32_t frames, uint32_t pixels);

} // namespace semrover
