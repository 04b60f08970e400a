// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"
#include "engine/scene/grid.h"
#include "runtime/base/dtype.h"
#include "runtime/base/json.h"
#include "tests/support/program.h"

#include <gtest/gtest.h>

namespace semrover {

// a piece of street: road, sidewalks, and walls on both sides; four points a voxel, three voxels without
inline VoxelGrid street_of_cells()
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    grid.points_per_voxel = 4;
    grid.metadata = {{"name", "a test's street"}, {"seed", "4"}};
    const auto add = [&](const Cell& cell, uint8_t label) {
        grid.cells.push_back(cell);
        grid.labels.push_back(label);
        for (int k = 0; k < 4; ++k)
            for (int axis = 0; axis < 3; ++axis) {
                const int noise = (cell[0] * 7 + cell[1] * 13 + cell[2] * 29 + k * 5 + axis * 3 + 600) % 11;
                grid.points.push_back(float_to_half(0.05f * float(noise - 5)));
                grid.colors.push_back(uint8_t(40 * label + 9 * noise + 20 * axis));
            }
        grid.generated.push_back(grid.cells.size() % 97 == 0 && std::ranges::count(grid.generated, 0) < 3 ? 0 : 1);
    };
    for (int i = 0; i < 24; ++i)
        for (int j = -6; j <= 6; ++j) {
            if (std::abs(j) == 6) {
                for (int k = 0; k < 8; ++k)
                    add({i, j, k}, 2);
            } else {
                add({i, j, 0}, std::abs(j) >= 4 ? 1 : 0);
            }
        }
    return grid;
}

// labels: flat; anything else: noisy. Every moment is another picture.
inline ImageRgb8 test_picture(const std::string& name, uint32_t moment, uint32_t width = 48, uint32_t height = 32)
{
    ImageRgb8 image{width, height, {}};
    uint32_t state = moment + 1;
    for (uint32_t y = 0; y < height; ++y)
        for (uint32_t x = 0; x < width; ++x) {
            state = state * 1664525 + 1013904223;
            for (uint32_t c = 0; c < 3; ++c) {
                const uint32_t flat = (x < width / 2 ? 40 * c : 200 - 30 * c) + moment;
                const uint32_t noisy = 20 + 3 * moment + y + 10 * c + (state >> 25);
                image.pixels.push_back(uint8_t(name == "labels" ? flat : noisy));
            }
        }
    return image;
}

// a folder with what a page is made of
class PageInputs {
  public:
    const std::filesystem::path& folder() const { return folder_.path(); }
    Path operator/(std::string_view name) const { return folder_ / name; }
    size_t entries() const { return folder_.entries(); }
    void put(std::string_view name, std::string_view text) const { folder_.put(name, text); }

    Path grid(std::string_view name) const
    {
        const Status status = write_grid(folder_ / name, street_of_cells());
        EXPECT_TRUE(status) << status.error().message;
        return folder_ / name;
    }

    void pictures(const std::string& name, const std::vector<uint32_t>& moments, uint32_t width = 48,
                  uint32_t height = 32) const
    {
        std::filesystem::create_directories(folder_ / name);
        for (const uint32_t moment : moments) {
            const Status status = write_png_rgb8(folder_ / name / fmt::format("{:06}.png", moment), width, height,
                                                 test_picture(name, moment, width, height).pixels);
            EXPECT_TRUE(status) << status.error().message;
        }
    }

    // --grid and the sets of pictures labels and splats
    std::string whole_arguments() const
    {
        return fmt::format("--grid {} --frames labels={} --frames splats={}", grid("a.sgrid").string(),
                           (folder_ / "labels").string(), (folder_ / "splats").string());
    }

    std::string run_and_figures() const
    {
        std::filesystem::create_directories(folder_ / "one.run");
        put("one.run/run.json",
            Json{{"settings",
                  {{"command", "generate"},
                   {"device", "llvmpipe"},
                   {"version", "semrover 0.1"},
                   {"steps", 50},
                   {"input", {{"cameras", {{{"width", 616}}}}}}}},
                 {"state", "finished"},
                 {"results", {{"cells", 12345}, {"seconds", 725.2}, {"peak_device_bytes", 1610612736}}}}
                .dump());
        put("two.json", R"({"settings": {"command": "refine", "seed": 3}, "state": "running"})");
        put("chamfer.json", R"({"mean": 0.0625, "note": "against truth", "whole": true})");
        put("drive.tum", "0 1 0 1.6 -0.5 0.5 -0.5 0.5\n1 4 0 1.6 -0.5 0.5 -0.5 0.5\n2 8 0.3 1.6 -0.5 0.5 -0.5 0.5\n");
        return fmt::format(" --run {0}/one.run --run {0}/two.json --figures {0}/chamfer.json --path {0}/drive.tum",
                           folder().string());
    }

    ProgramResult run(const std::string& arguments) const
    {
        return semrover_program("page -o " + (folder_ / "index.html").string() + " " + arguments);
    }

    // the page, which must come about
    std::string page(const std::string& arguments) const
    {
        const ProgramResult result = run("-y -q " + arguments);
        EXPECT_EQ(result.code, 0) << result.err;
        return contents(folder_ / "index.html");
    }

  private:
    ScratchFolder folder_;
};

} // namespace semrover
