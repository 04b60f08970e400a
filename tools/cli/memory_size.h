// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <cstdint>
#include <string_view>

namespace semrover {

// "6GiB", "500MB", "2.2" (a number below 4096 without a unit: GB), "2200000000" (bytes). K, M, G and T alone or with B
// are powers of 1000, with iB powers of 1024; case does not matter. Errors: usage
Result<uint64_t> parse_memory_size(std::string_view text);

} // namespace semrover
