// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace semrover {

// Element types of files and tensors (safetensors names in upper case). Shaders say which of them they take where they
// have a choice (runtime/graph/shader_interface.h), else it is f32, u32 or i32. q8_0 is of weights in device memory
// only: blocks of 32 int8 in a row, and an fp16 scale each.
enum class DType : uint8_t { f32, f16, bf16, i64, i32, u32, i16, u16, i8, u8, boolean, f64, u64, q8_0 };

// what a type stores together: an element, or some that share a scale
struct ElementBlock {
    uint32_t elements, bytes;
};
constexpr ElementBlock block_of(DType t)
{
    switch (t) {
    case DType::q8_0:
        return {32, 34};
    case DType::f64:
    case DType::i64:
    case DType::u64:
        return {1, 8};
    case DType::f32:
    case DType::i32:
    case DType::u32:
        return {1, 4};
    case DType::f16:
    case DType::bf16:
    case DType::i16:
    case DType::u16:
        return {1, 2};
    case DType::i8:
    case DType::u8:
    case DType::boolean:
        return {1, 1};
    }
    return {1, 0};
}
// of one element; none of blocks
constexpr uint64_t dtype_bytes(DType t)
{
    return block_of(t).elements == 1 ? block_of(t).bytes : 0;
}
// Of a row of `count` elements in device memory. Rows of blocks begin at 16-byte texels: all their int8, then all their
// scales, so that both are read in texels and a row is whole wherever it is cut off.
constexpr uint64_t row_bytes_of(DType t, uint64_t count)
{
    const ElementBlock block = block_of(t);
    const uint64_t bytes = count / block.elements * block.bytes;
    return block.elements == 1 ? bytes : (bytes + 15) / 16 * 16;
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
