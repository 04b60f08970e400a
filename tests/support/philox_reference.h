// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

// Philox4x32-10 and Box-Muller as the paper and textbooks give them, in integers and double
namespace semrover {

using Words4 = std::array<uint32_t, 4>;

inline Words4 philox_reference(Words4 counter, std::array<uint32_t, 2> key)
{
    for (int round = 0; round < 10; ++round) {
        const uint64_t a = uint64_t(0xD2511F53) * counter[0], b = uint64_t(0xCD9E8D57) * counter[2];
        counter = {uint32_t(b >> 32) ^ counter[1] ^ key[0], uint32_t(b), uint32_t(a >> 32) ^ counter[3] ^ key[1],
                   uint32_t(a)};
        key[0] += 0x9E3779B9;
        key[1] += 0xBB67AE85;
    }
    return counter;
}

// four normals of four words; 24 bits of each are used, the radius is never infinite
inline std::array<double, 4> normals_reference(const Words4& words)
{
    std::array<double, 4> z{};
    for (int pair = 0; pair < 2; ++pair) {
        const double u = ((words[2 * pair] >> 8) + 1) / 16777216.0, turn = (words[2 * pair + 1] >> 8) / 16777216.0;
        const double radius = std::sqrt(-2 * std::log(u)), angle = 2 * std::numbers::pi * turn;
        z[2 * pair] = radius * std::cos(angle);
        z[2 * pair + 1] = radius * std::sin(angle);
    }
    return z;
}

} // namespace semrover
