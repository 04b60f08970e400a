// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/dtype.h"

#include <cstring>

namespace semrover {

const char* dtype_name(DType t)
{
    static constexpr const char* kNames[] = {"F32", "F16", "BF16", "I64",  "I32", "U32", "I16",
                                             "U16", "I8",  "U8",   "BOOL", "F64", "U64"};
    return kNames[static_cast<int>(t)];
}

float half_to_float(uint16_t h)
{
    const uint32_t sign = uint32_t(h & 0x8000u) << 16;
    uint32_t exponent = (h >> 10) & 0x1fu, mantissa = h & 0x3ffu;
    uint32_t bits;
    if (exponent == 31) {
        bits = sign | 0x7f800000u | mantissa << 13;
    } else if (exponent != 0) {
        bits = sign | (exponent + 112) << 23 | mantissa << 13;
    } else if (mantissa == 0) {
        bits = sign;
    } else {
        exponent = 113;
        while (!(mantissa & 0x400u)) {
            mantissa <<= 1;
            --exponent;
        }
        bits = sign | exponent << 23 | (mantissa & 0x3ffu) << 13;
    }
    float f;
    std::memcpy(&f, &bits, 4);
    return f;
}

uint16_t float_to_half(float f)
{
    uint32_t bits;
    std::memcpy(&bits, &f, 4);
    const uint32_t sign = (bits >> 16) & 0x8000u;
    bits &= 0x7fffffffu;
    if (bits >= 0x7f800000u) // inf, nan
        return uint16_t(sign | 0x7c00u | (bits > 0x7f800000u ? 0x200u : 0u));
    if (bits >= 0x477ff000u) // rounds to 65536 or more
        return uint16_t(sign | 0x7c00u);
    if (bits < 0x38800000u) { // subnormal: value / 2^-24, rounded to even by the float adder
        float magnitude;
        std::memcpy(&magnitude, &bits, 4);
        magnitude += 0.5f; // ulp of [0.5, 1) is 2^-24
        uint32_t rounded;
        std::memcpy(&rounded, &magnitude, 4);
        return uint16_t(sign | (rounded - 0x3f000000u));
    }
    const uint32_t round = 0xfffu + ((bits >> 13) & 1u);
    return uint16_t(sign | ((bits + round - 0x38000000u) >> 13));
}

} // namespace semrover
