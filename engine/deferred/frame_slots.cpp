// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/deferred/frame_slots.h"

namespace semrover {

namespace {

// words that a frame's begin at a multiple of: 256 bytes, the most that devices want bindings to be aligned to
constexpr uint32_t kWordPadding = 64;

} // namespace

DeviceTensor frame_of(const DeviceTensor& slot, uint32_t frames, uint32_t number)
{
    const uint32_t rows = slot.rows() / frames;
    return slot.row_range(number * rows, rows);
}

Status write_frames(Device& device, const DeviceTensor& slot, uint32_t frames, std::span<const float> values)
{
    const size_t size = values.size() / frames;
    SR_ASSERT(values.size() == frames * size && size % slot.cols() == 0, "{} numbers for {} frames of '{}'",
              values.size(), frames, slot.name());
    for (uint32_t f = 0; f < frames; ++f)
        SR_CHECK(frame_of(slot, frames, f).write_rows(device, values.subspan(f * size, size)));
    return {};
}

Result<std::vector<float>> read_frames(Device& device, const DeviceTensor& slot, uint32_t frames, uint32_t pixels)
{
    std::vector<float> values;
    values.reserve(size_t(frames) * pixels * slot.cols());
    for (uint32_t f = 0; f < frames; ++f) {
        SR_TRY(const auto frame, frame_of(slot, frames, f).read_rows(device, pixels));
        values.insert(values.end(), frame.begin(), frame.end());
    }
    return values;
}

DeviceTensor frame_words(TensorPool& state, uint32_t frames, uint32_t count, std::string_view name)
{
    return state.tensor(frames * round_up(count, kWordPadding), 1, DType::u32, name, 1);
}

DeviceTensor words_of_frame(const DeviceTensor& words, uint32_t frames, uint32_t number, uint32_t count)
{
    return words.row_range(number * (words.rows() / frames), count);
}

void check_frames(Graph& g, const DeviceTensor& values, uint32_t frames, const PictureShape& shape,
                  const DeviceTensor& words)
{
    const Tensor all = values.in(g);
    const uint32_t rows = values.rows() / frames;
    for (uint32_t f = 0; f < frames; ++f)
        g.keep(first_non_finite(g, all.row_range(f * rows, rows), shape), words_of_frame(words, frames, f, 1));
}

Status check_frame_words(Device& device, const DeviceTensor& words, const DeviceTensor& values, uint32_t frames,
                         const PictureShape& shape, std::string_view what)
{
    SR_TRY(const std::vector<uint32_t> all, words.read<uint32_t>(device));
    for (uint32_t f = 0; f < frames; ++f) {
        const uint32_t bad = all[f * (words.rows() / frames)];
        if (bad == ~0u)
            continue;
        const uint32_t channels = values.cols(), pixel = bad / channels;
        const uint32_t row = pixel / shape.width * shape.padded_width + pixel % shape.width;
        SR_TRY(const auto value, frame_of(values, frames, f).row_range(row, 1).read_rows(device, 1));
        const size_t before = size_t(f) * shape.width * shape.height * channels;
        return fail(ErrorCode::internal, "{} holds {} at element {}: overflow; try `precision` fp32", what,
                    value[bad % channels], before + bad);
    }
    return {};
}

} // namespace semrover
