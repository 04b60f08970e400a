// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/picture_encoding.h"
#include "tools/cli/commands.h"

namespace semrover {

// how pictures are written: --format, --quality, --png-level and --threads, which `render` and `refine` share
void add_picture_options(CLI::App& command, PictureEncoding& encoding, uint32_t& threads);

// --depth: one of these words of kDepthFormats
void add_depth_option(CLI::App& command, DepthFormat& depth, std::vector<std::string> words, const std::string& more);

// --flow png|flo
void add_flow_option(CLI::App& command, PictureEncoding& encoding);

} // namespace semrover
