// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/safetensors.h"

#include "tests/support/safetensors_bytes.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <gtest/gtest.h>

namespace semrover {
namespace safetensors_test {

template <typename T>
std::span<const std::byte> bytes_of(const std::vector<T>& values)
{
    return std::as_bytes(std::span(values));
}

TEST(Safetensors, files_that_the_reference_reader_accepts_open)
{
    const ScratchFolder folder;
    const std::string a = entry("a", "U8", "4", "0,4");
    for (const std::string& file :
         {safetensors_bytes("{}"), safetensors_bytes("{\"__metadata__\":{}}"), safetensors_bytes("  \n\t{ }\r\n  "),
          safetensors_bytes(header_of(a), "xxxx"), safetensors_bytes(header_of(a) + "    ", "xxxx"),
          safetensors_bytes(header_of(entry("s", "F32", "", "0,4")), "xxxx"), // scalar
          safetensors_bytes(header_of(entry("z", "F32", "0,5", "0,0"))),      // no elements
          safetensors_bytes(header_of(entry("", "U8", "4", "0,4")), "xxxx"),  // empty name
          safetensors_bytes(header_of(entry("gr\xc3\xbc\xc3\x9f", "U8", "4", "0,4")), "xxxx"),
          safetensors_bytes(header_of(entry("a..b/..c", "U8", "4", "0,4")), "xxxx"),
          safetensors_bytes(header_of(entry("a", "U8", "1,1,1,1,1,1,1,4", "0,4")), "xxxx"), // rank 8
          safetensors_bytes(header_of(entry("a", "F4", "8", "0,4")), "xxxx"),
          safetensors_bytes(header_of(entry("a", "F6_E3M2", "4", "0,3")), "xxx"),
          safetensors_bytes(header_of(entry("a", "C64", "1", "0,8")), "xxxxxxxx"),
          safetensors_bytes(R"({"__metadata__":{"note":"two\nlines"}})"),
          safetensors_bytes(R"({"a":{"data_offsets":[0,2],"dtype":"BF16","shape":[1]}})", "xx"),
          safetensors_bytes(header_of(entry("b", "U8", "4", "4,8"), a), "xxxxyyyy"),
          safetensors_bytes(header_of(a, entry("z", "U8", "0", "4,4")), "xxxx")}) {
        const auto result = Safetensors::open(folder.put("x", file));
        EXPECT_TRUE(result) << result.error().message;
    }
}

TEST(Safetensors, every_file_of_the_repository_opens)
{
    size_t count = 0;
    for (const char* root : {"/tests/golden", "/assets"})
        for (const auto& file : std::filesystem::recursive_directory_iterator(std::string(SEMROVER_SOURCE_DIR) + root))
            if (file.path().extension() == ".safetensors" || file.path().extension() == ".sgrid") {
                const auto result = Safetensors::open(file.path(), {.strict = true});
                EXPECT_TRUE(result) << result.error().message;
                ++count;
            }
    EXPECT_GE(count, 20u);
}

TEST(Safetensors, a_written_file_reads_back_the_same)
{
    const ScratchFolder folder;
    const std::vector<float> floats = {1, -2, 3.5f, 0, 1e-30f, 6};
    const std::vector<uint8_t> octets = {1, 2, 3};
    const std::vector<uint16_t> halves = {0x3c00, 0x8000};
    const std::map<std::string, std::string> metadata = {{"note", "a \"b\"\n"}, {"voxel_size", "0.6"}};
    const std::vector<TensorData> tensors = {{"u", DType::u8, {3}, bytes_of(octets)},
                                             {"h", DType::f16, {2, 1}, bytes_of(halves)},
                                             {"none", DType::i64, {0, 7}, {}},
                                             {"f", DType::f32, {2, 3}, bytes_of(floats)}};
    ASSERT_TRUE(write_safetensors(folder / "x", tensors, metadata));
    const Safetensors file = Safetensors::open(folder / "x", {.strict = true}).value();
    EXPECT_EQ(file.metadata(), metadata);
    ASSERT_EQ(file.tensors().size(), 4u);
    for (const TensorData& expected : tensors) {
        const TensorInfo* tensor = file.find(expected.name);
        ASSERT_TRUE(tensor);
        EXPECT_EQ(tensor->dtype, expected.dtype);
        EXPECT_EQ(tensor->shape, expected.shape);
        EXPECT_TRUE(std::ranges::equal(file.bytes(*tensor), expected.bytes));
        EXPECT_EQ(reinterpret_cast<uintptr_t>(file.bytes(*tensor).data()) % dtype_bytes(tensor->dtype), 0u);
    }
    EXPECT_EQ(file.find("f")->elements(), 6u);
    EXPECT_TRUE(says(file.get("x"), "there is no tensor 'x'"));
}

TEST(Safetensors, the_same_tensors_in_any_order_give_the_same_bytes)
{
    const ScratchFolder folder;
    const std::vector<uint32_t> words = {1, 2};
    const std::vector<uint8_t> octets = {3};
    std::vector<TensorData> tensors = {{"b", DType::u8, {1}, bytes_of(octets)},
                                       {"z", DType::u32, {2}, bytes_of(words)},
                                       {"a", DType::u8, {1}, bytes_of(octets)}};
    ASSERT_TRUE(write_safetensors(folder / "x", tensors));
    std::reverse(tensors.begin(), tensors.end());
    ASSERT_TRUE(write_safetensors(folder / "y", tensors));
    const std::string bytes = contents(folder / "x");
    EXPECT_EQ(bytes, contents(folder / "y"));
    EXPECT_EQ(bytes.size() % 8, (8 + 8 + 2) % 8u);
    EXPECT_EQ(bytes.find(R"({"z":{"dtype":"U32","shape":[2],"data_offsets":[0,8]},"a":)"), 8u);
}

TEST(Safetensors, a_file_that_cannot_be_written_is_an_error)
{
    const ScratchFolder folder;
    EXPECT_TRUE(says(write_safetensors(folder / "no" / "x", {}), "cannot write"));
}

TEST(SafetensorsDeathTest, a_tensor_given_with_the_wrong_size_or_twice_is_a_bug)
{
    const ScratchFolder folder;
    const std::vector<uint8_t> octets = {1, 2, 3};
    const TensorData wrong{"u", DType::f32, {3}, bytes_of(octets)};
    EXPECT_DEATH(static_cast<void>(write_safetensors(folder / "x", std::span(&wrong, 1))), "given with 3 bytes");
    const TensorData twice[] = {{"u", DType::u8, {3}, bytes_of(octets)}, {"u", DType::i16, {0}, {}}};
    EXPECT_DEATH(static_cast<void>(write_safetensors(folder / "x", twice)), "given twice");
}

TEST(CheckedBytes, a_size_is_exact_or_refused)
{
    EXPECT_EQ(checked_bytes(std::vector<uint64_t>{}, DType::f16).value(), 2u);
    EXPECT_EQ(checked_bytes(std::vector<uint64_t>{3, 5}, DType::f64).value(), 120u);
    EXPECT_EQ(checked_bytes(std::vector<uint64_t>{kMaxDim, 0}, DType::f64).value(), 0u);
    EXPECT_EQ(checked_bytes(std::vector<uint64_t>{2}, 4u).value(), 1u);
    EXPECT_FALSE(checked_bytes(std::vector<uint64_t>{3}, 4u));
    EXPECT_FALSE(checked_bytes(std::vector<uint64_t>{kMaxDim, uint64_t(1) << 21}, DType::u8));
    EXPECT_FALSE(checked_bytes(std::vector<uint64_t>(9, 1), DType::u8));
}

} // namespace safetensors_test
} // namespace semrover
