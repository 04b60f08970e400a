// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"
#include "engine/scene/grid.h"
#include "runtime/base/safetensors.h"
#include "tests/support/scratch_folder.h"

#include <gtest/gtest.h>

namespace semrover {

// the networks of a golden case of renderers as a model's folder, with its conditioning
inline void put_renderer_model(const std::filesystem::path& folder, const char* name = "asd_rollout_tiny")
{
    namespace fs = std::filesystem;
    const fs::path golden = fs::path(SEMROVER_SOURCE_DIR "/tests/golden") / name;
    fs::create_directories(folder / "conditioning");
    fs::copy(golden / "model" / "unet", folder / "renderer");
    fs::copy(golden / "model" / "vae", folder / "vae");
    const auto file = Safetensors::open(golden / "tensors.safetensors");
    const TensorInfo& text = **file->get("input.encoder_hidden_states");
    const TensorData tensor{"encoder_hidden_states", text.dtype, text.shape, file->bytes(text)};
    ASSERT_TRUE(write_safetensors(folder / "conditioning" / "conditioning.safetensors", {&tensor, 1}));
}

// of videos: windows of 6 frames, by its num_frames
inline void put_video_model(const std::filesystem::path& folder)
{
    put_renderer_model(folder, "vsd_window_tiny");
}

// splat buffers of a drive towards a wall: stripes that grow, seen in the lower two thirds
inline void put_buffers(const std::filesystem::path& folder, uint32_t frames, uint32_t width, uint32_t height,
                        uint32_t hue = 0)
{
    for (const char* kind : {"color", "visible", "label"})
        std::filesystem::create_directories(folder / kind);
    for (uint32_t f = 0; f < frames; ++f) {
        std::vector<uint8_t> color, visible, label;
        for (uint32_t y = 0; y < height; ++y)
            for (uint32_t x = 0; x < width; ++x) {
                const bool seen = y > height / 3 && (x + y) % 7;
                const uint32_t stripe = x / (3 + f) % 3;
                for (uint32_t c = 0; c < 3; ++c)
                    color.push_back(seen ? uint8_t(60 + 70 * ((stripe + c + hue) % 3) + y) : 0);
                visible.push_back(seen ? 255 : 0);
                label.push_back(seen ? uint8_t(stripe) : 255);
            }
        const std::string name = fmt::format("{:06}.png", f);
        ASSERT_TRUE(write_png_rgb8(folder / "color" / name, width, height, color));
        ASSERT_TRUE(write_png_gray8(folder / "visible" / name, width, height, visible));
        ASSERT_TRUE(write_png_gray8(folder / "label" / name, width, height, label));
    }
}

// a road of 12 x 20 voxels, each with points
inline VoxelGrid street()
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    grid.points_per_voxel = 20;
    for (int32_t i = 0; i < 20; ++i)
        for (int32_t j = 0; j < 12; ++j)
            grid.cells.push_back({i, j, 0});
    for (size_t i = 0; i < grid.cells.size(); ++i) {
        grid.labels.push_back(0);
        grid.generated.push_back(1);
        for (uint32_t p = 0; p < 20; ++p) {
            for (float offset : {float(p % 5) * 0.12f - 0.24f, float(p / 5) * 0.14f - 0.21f, 0.f})
                grid.points.push_back(float_to_half(offset));
            grid.colors.insert(grid.colors.end(), {uint8_t(10 * p), uint8_t(i), uint8_t(90)});
        }
    }
    sort_cells(grid);
    return grid;
}

} // namespace semrover
