// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <array>
#include <string>

namespace CLI {
class App;
}

namespace semrover {

// --origin X,Y,Z
void add_origin(CLI::App& command, std::string& text);

// bad use for what is not three numbers; 0, 0, 0 where the text is empty
Result<std::array<double, 3>> origin_from(const std::string& text);

} // namespace semrover
