// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/dtype.h"

#include "runtime/base/result.h"

#include <algorithm>
#include <cstring>

namespace semrover {

const char* dtype_name(DType t)
{
    static constexpr const char* kNames[] = {"F32", "F16", "BF16", "I64",  "I32", "U32", "I16",
                                             "U16", "I8",  "U8",   "BOOL", "F64", "U64", "Q8_0"};
    return kNames[static_cast<int>(t)];
}

float half_to_float(uint16_t h)
{
    const uint32_t sign = uint32_t(h & 0x8000u) << 16, exponent = (h >> 10) & 0x1fu, mantissa = h & 0x3ffu;
    const float subnormal = float(int32_t(mantissa)) * 0x1p-24f; // exact
    uint32_t small;
    std::memcpy(&small, &subnormal, 4);
    const uint32_t large = (exponent + (exponent == 31 ? 224u : 112u)) << 23 | mantissa << 13;
    const uint32_t bits = sign | (exponent == 0 ? small : large); // no branch, so that loops become vectors
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
    float magnitude;
    std::memcpy(&magnitude, &bits, 4);
    magnitude += 0.5f; // ulp of [0.5, 1) is 2^-24: the adder rounds a subnormal to even
    uint32_t small;
    std::memcpy(&small, &magnitude, 4);
    small -= 0x3f000000u;
    const uint32_t normal = (bits + 0xfffu + ((bits >> 13) & 1u) - 0x38000000u) >> 13;
    const uint32_t special = bits > 0x7f800000u ? 0x7e00u : 0x7c00u; // NaN; infinite, or rounds to 65536 or more
    return uint16_t(sign | (bits >= 0x477ff000u ? special : bits < 0x38800000u ? small : normal));
}

uint16_t float_to_bf16(float f)
{
    uint32_t bits;
    std::memcpy(&bits, &f, 4);
    if ((bits & 0x7fffffffu) > 0x7f800000u)
        return uint16_t(bits >> 16 | 0x40u); // NaN stays one
    return uint16_t((bits + 0x7fffu + (bits >> 16 & 1u)) >> 16);
}

void to_float(std::span<const std::byte> bytes, DType dtype, float* out)
{
    if (dtype == DType::f32) {
        std::copy_n(bytes.data(), bytes.size(), reinterpret_cast<std::byte*>(out));
        return;
    }
    SR_ASSERT(dtype == DType::f16 || dtype == DType::bf16, "{} as float", dtype_name(dtype));
    const auto convert = [&](auto decode) {
        for (size_t i = 0; i < bytes.size() / 2; ++i) {
            uint16_t word;
            std::memcpy(&word, bytes.data() + 2 * i, 2);
            out[i] = decode(word);
        }
    };
    if (dtype == DType::f16)
        convert([](uint16_t word) { return half_to_float(word); });
    else
        convert([](uint16_t word) { return bf16_to_float(word); });
}

void from_float(std::span<const float> values, DType dtype, std::byte* out)
{
    if (dtype == DType::f32) {
        std::ranges::copy(std::as_bytes(values), out);
        return;
    }
    SR_ASSERT(dtype == DType::f16 || dtype == DType::bf16, "float as {}", dtype_name(dtype));
    for (size_t i = 0; i < values.size(); ++i) {
        const uint16_t word = dtype == DType::f16 ? float_to_half(values[i]) : float_to_bf16(values[i]);
        std::memcpy(out + 2 * i, &word, 2);
    }
}

namespace {

// numbers whose exponent bits are all ones are NaN or infinite
template <typename Bits>
std::optional<uint64_t> first_with_exponent(std::span<const std::byte> bytes, Bits mask)
{
    const auto matches = [&](uint64_t i) {
        Bits value;
        std::memcpy(&value, bytes.data() + i * sizeof(Bits), sizeof(Bits));
        return (value & mask) == mask;
    };
    constexpr uint64_t kBlock = 4096; // without a way out, so that its loop becomes vectors
    const uint64_t count = bytes.size() / sizeof(Bits);
    for (uint64_t first = 0; first < count; first += kBlock) {
        const uint64_t end = std::min(first + kBlock, count);
        Bits any = 0;
        for (uint64_t i = first; i < end; ++i)
            any |= Bits(matches(i));
        for (uint64_t i = first; any && i < end; ++i)
            if (matches(i))
                return i;
    }
    return std::nullopt;
}

} // namespace

std::optional<uint64_t> first_non_finite(std::span<const std::byte> bytes, DType dtype)
{
    switch (dtype) {
    case DType::f16:
        return first_with_exponent<uint16_t>(bytes, 0x7c00);
    case DType::bf16:
        return first_with_exponent<uint16_t>(bytes, 0x7f80);
    case DType::f32:
        return first_with_exponent<uint32_t>(bytes, 0x7f800000);
    case DType::f64:
        return first_with_exponent<uint64_t>(bytes, 0x7ff0000000000000);
    default:
        return std::nullopt;
    }
}

} // namespace semrover
