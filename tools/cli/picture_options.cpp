// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/picture_options.h"

#include "tools/cli/value_options.h"

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

} // namespace semrover
