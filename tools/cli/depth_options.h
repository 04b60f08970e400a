// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/dataset/depth_image.h"

namespace CLI {
class App;
}

namespace semrover {

// --depth-kind and --depth-scale: how pictures hold depth
void add_depth_options(CLI::App& command, DepthEncoding& encoding);

std::string_view name_of(std::optional<DepthKind> kind); // "auto" where there is none

} // namespace semrover
