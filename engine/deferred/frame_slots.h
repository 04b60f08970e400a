// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/picture.h"
#include "runtime/device/tensor_pool.h"

// Slots that hold the frames of a video: images one after the other, each padded to kImageRowPadding rows.
namespace semrover {

DeviceTensor frame_of(const DeviceTensor& slot, uint32_t frames, uint32_t number);

// values: [frames, pixels, columns of the slot]
Status write_frames(Device& device, const DeviceTensor& slot, uint32_t frames, std::span<const float> values);
// -> [frames, pixels, columns of the slot]; pixels: of a frame, the first ones
Result<std::vector<float>> read_frames(Device& device, const DeviceTensor& slot, uint32_t frames, uint32_t pixels);

// u32 words, `count` of each frame, where each frame's can be bound
DeviceTensor frame_words(TensorPool& state, uint32_t frames, uint32_t count, std::string_view name);
DeviceTensor words_of_frame(const DeviceTensor& words, uint32_t frames, uint32_t number, uint32_t count);

// first_non_finite() of each frame of `values`, to one word each
void check_frames(Graph& g, const DeviceTensor& values, uint32_t frames, const PictureShape& shape,
                  const DeviceTensor& words);
// reads them. Errors: internal for a number that is NaN or infinite; its element is counted over all frames
Status check_frame_words(Device& device, const DeviceTensor& words, const DeviceTensor& values, uint32_t frames,
                         const PictureShape& shape, std::string_view what);

} // namespace semrover
