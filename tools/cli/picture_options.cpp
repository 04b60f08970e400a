// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/picture_options.h"

#include "tools/cli/value_options.h"

#include <algorithm>
#include <CLI/CLI.hpp>

namespace semrover {

namespace {

constexpr uint32_t kMostThreads = 256;

} // namespace

void add_picture_options(CLI::App& c, PictureEncoding& encoding, uint32_t& threads)
{
    add_choice(c, "--format", {"png", "jpeg"}, "of colours",
               [&encoding](const std::string& text) { encoding.jpeg = text == "jpeg"; });
    add_number(c, "--quality", encoding.quality, "of JPEG", 1, 100);
    add_number(c, "--png-level", encoding.png_level, "how hard PNG is compressed, 0: not", 0, 9);
    add_number(
        c, "--threads", threads,
        "that make files while the next are drawn; what the process may use, 16 at most, or $SLURM_CPUS_PER_TASK", 1u,
        kMostThreads);
}

void add_depth_option(CLI::App& c, DepthFormat& depth, std::vector<std::string> words, const std::string& more)
{
    add_choice(c, "--depth", std::move(words),
               "of depth: 16-bit PNG of 1/1000 m (to 65.53 m), 1/100 m (655.34 m) or 1/256 m (255.99 m, KITTI's)" +
                   more,
               [&depth](const std::string& word) {
                   depth = DepthFormat(std::ranges::find(kDepthFormats, word) - kDepthFormats);
               });
}

void add_flow_option(CLI::App& c, PictureEncoding& encoding)
{
    add_choice(
        c, "--flow", {kFlowFormats.begin(), kFlowFormats.end()},
        "also optical flow to the camera's next frame, flow/000000 in KITTI's 16-bit PNG or Middlebury's .flo, and "
        "flow_state/000000.png: 1 seen there, 2 hidden, 3 outside, 0 nothing",
        [&encoding](const std::string& word) {
            encoding.flow = FlowFormat(std::ranges::find(kFlowFormats, word) - kFlowFormats.begin());
        });
}

} // namespace semrover
