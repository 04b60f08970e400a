// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <initializer_list>

namespace semrover {

// splitmix64 (Steele, Lea, Flood 2014): the output function, one to one, and the increment of its counter
constexpr uint64_t kMixStep = 0x9e3779b97f4a7c15;
constexpr uint64_t mix64(uint64_t z)
{
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
}

// Counter-based random numbers: the n-th draw of an object depends on the seed, the object's key and n only, so that
// objects never disturb each other. The mixer is SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number
// generators", 2014).
class KeyedRandom {
  public:
    KeyedRandom(uint64_t seed, std::initializer_list<uint64_t> key) : state_(mix64(seed + kMixStep))
    {
        for (uint64_t k : key)
            state_ = mix64(state_ ^ mix64(k + 0x632be59bd9b4e019u));
    }

    uint32_t bits() { return uint32_t(mix64(state_ + kMixStep * ++count_) >> 32); }
    double uniform() { return bits() * (1.0 / 4294967296.0); } // [0, 1)
    double uniform(double low, double high) { return low + (high - low) * uniform(); }
    uint32_t below(uint32_t n) { return uint32_t((uint64_t(bits()) * n) >> 32); }
    bool chance(double p) { return uniform() < p; }
    template <typename T, std::size_t N>
    const T& pick(const T (&values)[N])
    {
        return values[below(uint32_t(N))];
    }

  private:
    uint64_t state_, count_ = 0;
};

} // namespace semrover
