// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <cstdint>
#include <string>
#include <string_view>

namespace semrover {

// a class by its name or number, as the value of an option. usage names the option and the classes
Result<uint8_t> class_option(std::string_view option, const std::string& text);

} // namespace semrover
