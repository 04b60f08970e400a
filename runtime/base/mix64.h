// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace semrover {

// splitmix64 (Steele, Lea, Flood 2014): the output function, one to one, and the increment of its counter
constexpr uint64_t kMixStep = 0x9e3779b97f4a7c15;
constexpr uint64_t mix64(uint64_t z)
{
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
}

} // namespace semrover
