// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace semrover {

// element types of files and tensors (safetensors names in upper case); the graph computes on f32, f16, u32, i32
enum class DType : uint8_t { f32, f16, bf16, i64, i32, u32, i16, u16, i8, u8, boolean, f64, u64 };

constexpr uint64_t dtype_bytes(DType t)
{
    switch (t) {
    case DType::f64:
    case DType::i64:
    case DType::u64:
        return 8;
    case DType::f32:
    case DType::i32:
    case DType::u32:
        return 4;
    case DType::f16:
    case DType::bf16:
    case DType::i16:
    case DType::u16:
        return 2;
    case DType::i8:
    case DType::u8:
    case DType::boolean:
        return 1;
    }
    return 0;
}

const char* dtype_name(DType t); // "F32", "F16", ...

// IEEE 754 binary16, round to nearest even
float half_to_float(uint16_t h);
uint16_t float_to_half(float f);
inline float bf16_to_float(uint16_t b)
{
    const uint32_t u = uint32_t(b) << 16;
    float f;
    __builtin_memcpy(&f, &u, 4);
    return f;
}
uint16_t float_to_bf16(float f); // round to nearest even

// a tensor's elements, which may be misaligned, of type f32, f16 or bf16
void to_float(std::span<const std::byte> bytes, DType dtype, float* out);
void from_float(std::span<const float> values, DType dtype, std::byte* out);

// index of the first element that is NaN or infinite; none for integers. `bytes` may be misaligned.
std::optional<uint64_t> first_non_finite(std::span<const std::byte> bytes, DType dtype);

} // namespace semrover
