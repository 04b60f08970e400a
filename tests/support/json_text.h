// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"

#include <iosfwd>
#include <string>

namespace semrover {

// JSON that a test has at hand; throws where it is none. Compiled once: the parser and the printer take a second of
// each test's compile time otherwise.
nlohmann::json json_of(const std::string& text);

} // namespace semrover

NLOHMANN_JSON_NAMESPACE_BEGIN
void PrintTo(const json& value, std::ostream* out); // how GoogleTest shows one
NLOHMANN_JSON_NAMESPACE_END
