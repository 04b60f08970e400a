// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/npy.h"

namespace semrover {

// The numbers of an array of any type, as T (uint8_t, int32_t or uint32_t): integers, booleans, and floats that are
// whole. bad_input, with `where` in front, for a number that T cannot hold.
template <typename T>
Result<std::vector<T>> whole_numbers(const NpyArray& array, std::string_view where);

} // namespace semrover
