// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace semrover {

std::string bytes_text(uint64_t bytes); // "412 MiB"

} // namespace semrover
