// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// what the reader must refuse, each with its own words; the list is that of the faults found in other readers
#include "runtime/base/safetensors.h"
#include "tests/support/safetensors_bytes.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <chrono>
#include <gtest/gtest.h>
#include <random>

namespace semrover {
namespace safetensors_reject_test {

struct Case {
    const char* name;
    std::string file;
    const char* error;
    SafetensorsLimits limits = {};
};

std::string with_length(uint64_t length)
{
    std::string file = safetensors_bytes("{}");
    for (size_t i = 0; i < 8; ++i)
        file[i] = static_cast<char>(length >> (8 * i));
    return file;
}

std::string tensor(std::string_view dtype, std::string_view shape, std::string_view offsets, size_t data = 4)
{
    return safetensors_bytes(header_of(entry("a", dtype, shape, offsets)), std::string(data, 'x'));
}

std::string tensors(const std::vector<std::string>& entries, size_t data)
{
    std::string header = "{";
    for (const std::string& e : entries)
        header.append(header.size() > 1 ? "," : "").append(e);
    return safetensors_bytes(header + "}", std::string(data, 'x'));
}

std::vector<Case> length_cases()
{
    return {
        {"empty", "", "found only 0 bytes"},
        {"seven_bytes", std::string(7, '\0'), "found only 7 bytes"},
        {"header_of_0", with_length(0).substr(0, 8), "the header is empty"},
        {"header_of_1", safetensors_bytes("{"), "not valid JSON"},
        {"header_of_spaces", safetensors_bytes("        "), "the header is empty"},
        {"header_of_2_63", with_length(uint64_t(1) << 63), "header of 9223372036854775808 bytes, at most 100000000"},
        {"header_of_2_64_less_1", with_length(~uint64_t(0)), "header of 18446744073709551615 bytes"},
        {"header_of_2_64_less_8", with_length(~uint64_t(7)), "header of 18446744073709551608 bytes"},
        {"header_as_long_as_the_file", with_length(10), "header of 10 bytes, but only 2 follow"},
        {"header_one_byte_too_long", with_length(3), "header of 3 bytes, but only 2 follow"},
        {"header_over_100_mb", with_length(100'000'001), "header of 100000001 bytes"},
        {"header_over_a_lower_limit", safetensors_bytes("{    }"), "at most 5 are allowed", {.header_bytes = 5}},
    };
}

std::vector<Case> json_cases()
{
    const std::string e = entry("a", "U8", "4", "0,4");
    return {
        {"array", safetensors_bytes("[]"), "expected the header to be an object, found an array"},
        {"open_array", safetensors_bytes("["), "expected the header to be an object"},
        {"number", safetensors_bytes("7"), "expected the header to be an object, found the number 7"},
        {"text", safetensors_bytes("\"a\""), "expected the header to be an object, found 'a'"},
        {"null", safetensors_bytes("null"), "found null"},
        {"strict_space", safetensors_bytes(" {}"), "white space before the header", {.strict = true}},
        {"garbage_after", safetensors_bytes("{}x"), "not valid JSON at byte 3"},
        {"second_object", safetensors_bytes("{}{}"), "not valid JSON at byte 3"},
        {"nul_after", safetensors_bytes(std::string("{}\0\0", 4)), "NUL at byte 2"},
        {"missing_brace", safetensors_bytes(fmt::format("{{{}", e), "xxxx"), "not valid JSON"},
        {"missing_comma", safetensors_bytes(header_of(e + entry("b", "U8", "0", "4,4")), "xxxx"), "not valid JSON"},
        {"trailing_comma", safetensors_bytes(fmt::format("{{{},}}", e), "xxxx"), "not valid JSON"},
        {"comment", safetensors_bytes("{/* */}"), "not valid JSON"},
        {"byte_order_mark", safetensors_bytes("\xef\xbb\xbf{}"), "byte order mark"},
        {"utf16", safetensors_bytes(std::string("{\0}\0", 4)), "NUL at byte 1"},
        {"invalid_utf8", safetensors_bytes("{\"\xff\":1}"), "ill-formed UTF-8"},
        {"overlong_utf8", safetensors_bytes("{\"\xc0\x80\":1}"), "ill-formed UTF-8"},
        {"lone_surrogate", safetensors_bytes("{\"\\ud800\":1}"), "not valid JSON"},
        {"depth_bomb_of_arrays", safetensors_bytes(std::string(1 << 20, '[')), "expected the header to be an object"},
        {"depth_bomb_in_shape", safetensors_bytes(fmt::format(R"({{"a":{{"shape":{:[<{}})", "", 1 << 20)),
         "expected shape to hold whole numbers, found an array"},
        {"depth_bomb_of_objects", safetensors_bytes("{\"a\":{\"dtype\":{\"a\":{"), "expected dtype to be text"},
    };
}

std::vector<Case> name_cases()
{
    const std::string a = entry("a", "U8", "4", "0,4");
    return {
        {"nul_in_name", tensors({entry("a\\u0000b", "U8", "4", "0,4")}, 4), "holds a control character"},
        {"newline_in_name", tensors({entry("a\\nb", "U8", "4", "0,4")}, 4), "name 'a\\x0ab' holds a control character"},
        {"raw_control_in_name", tensors({entry("a\x01", "U8", "4", "0,4")}, 4), "not valid JSON"},
        {"name_of_513", tensors({entry(std::string(513, 'n'), "U8", "4", "0,4")}, 4), "has 513 bytes"},
        {"path_in_name", tensors({entry("a/../../b", "U8", "4", "0,4")}, 4), "holds '/../'"},
        {"same_name_twice", tensors({a, entry("a", "U8", "4", "4,8")}, 8), "tensor 'a' appears twice"},
        {"same_name_escaped", tensors({a, entry("\\u0061", "U8", "4", "4,8")}, 8), "tensor 'a' appears twice"},
        {"same_name_unsupported", tensors({a, entry("a", "F8_E4M3", "4", "4,8")}, 8), "tensor 'a' appears twice"},
        {"tensor_is_null", safetensors_bytes("{\"a\":null}"), "tensor 'a': expected an object, found null"},
        {"tensor_is_array", safetensors_bytes("{\"a\":[\"U8\",[4],[0,4]]}", "xxxx"),
         "expected an object, found an array"},
        {"metadata_is_text", safetensors_bytes("{\"__metadata__\":\"x\"}"), "expected __metadata__ to be an object"},
        {"metadata_number", safetensors_bytes("{\"__metadata__\":{\"k\":1}}"),
         "metadata 'k': expected text, found the number 1"},
        {"metadata_object", safetensors_bytes("{\"__metadata__\":{\"k\":{}}}"),
         "metadata 'k': expected text, found an object"},
        {"metadata_key_twice", safetensors_bytes(R"({"__metadata__":{"k":"1","k":"1"}})"),
         "metadata 'k' appears twice"},
        {"metadata_twice", safetensors_bytes(R"({"__metadata__":{},"__metadata__":{}})"), "__metadata__ appears twice"},
        {"metadata_control_key", safetensors_bytes(R"({"__metadata__":{"\u0007":"1"}})"), "holds a control character"},
        {"no_dtype", safetensors_bytes(R"({"a":{"shape":[],"data_offsets":[0,0]}})"), "tensor 'a': dtype is missing"},
        {"no_shape", safetensors_bytes(R"({"a":{"dtype":"U8","data_offsets":[0,0]}})"), "tensor 'a': shape is missing"},
        {"no_offsets", safetensors_bytes(R"({"a":{"dtype":"U8","shape":[]}})"), "tensor 'a': data_offsets is missing"},
        {"unknown_field", safetensors_bytes(R"({"a":{"dtype":"U8","stride":[1]}})"), "unknown field 'stride'"},
        {"dtype_twice", safetensors_bytes(R"({"a":{"dtype":"U8","dtype":"U8"}})"), "dtype appears twice"},
        {"shape_twice", safetensors_bytes(R"({"a":{"shape":[],"shape":[]}})"), "shape appears twice"},
        {"offsets_twice", safetensors_bytes(R"({"a":{"data_offsets":[0,0],"data_offsets":[0,4]}})"),
         "data_offsets appears twice"},
    };
}

std::vector<Case> number_cases()
{
    return {
        {"offsets_of_1", tensor("U8", "4", "4"), "expected 2 data_offsets, found 1"},
        {"offsets_of_3", tensor("U8", "4", "0,4,4"), "expected 2 data_offsets, found more"},
        {"offsets_empty", tensor("U8", "4", ""), "expected 2 data_offsets, found 0"},
        {"offset_negative", tensor("U8", "4", "-4,0"), "whole numbers, found the negative number -4"},
        {"offset_minus_zero", tensor("U8", "4", "-0,4"), "whole numbers, found the negative number -0"},
        {"offset_float", tensor("U8", "4", "0,4.0"), "whole numbers, found the number 4.0"},
        {"offset_exponent", tensor("U8", "4", "0,4e0"), "whole numbers, found the number 4e0"},
        {"offset_text", tensor("U8", "4", "0,\"4\""), "whole numbers, found '4'"},
        {"offset_over_2_53", tensor("U8", "4", "0,9007199254740993"), "9007199254740993 exceeds 2^53"},
        {"offset_over_2_64", tensor("U8", "4", "0,18446744073709551620"), "found the number 18446744073709551620"},
        {"offset_leading_zero", tensor("U8", "4", "0,04"), "not valid JSON"},
        {"offsets_not_an_array", safetensors_bytes(R"({"a":{"data_offsets":4}})"),
         "expected data_offsets to be an array"},
        {"offsets_swapped", tensor("U8", "4", "4,0"), "end at 0 before they begin at 4"},
        {"shape_not_an_array", safetensors_bytes(R"({"a":{"shape":4}})"),
         "expected shape to be an array, found the number 4"},
        {"dim_negative", tensor("U8", "-4", "0,4"), "whole numbers, found the negative number -4"},
        {"dim_float", tensor("U8", "4.0", "0,4"), "whole numbers, found the number 4.0"},
        {"dim_exponent", tensor("U8", "1e3", "0,4"), "whole numbers, found the number 1e3"},
        {"dim_null", tensor("U8", "null", "0,4"), "whole numbers, found null"},
        {"dim_true", tensor("U8", "true", "0,4"), "whole numbers, found true"},
        {"dim_over_2_40", tensor("U8", "1099511627777", "0,4"), "dimension over 2^40"},
        {"rank_9", tensor("U8", "1,1,1,1,1,1,1,1,4", "0,4"), "more than 8 dimensions"},
        {"shape_wraps_to_0", tensor("F32", "4294967296,4294967296", "0,0", 0), "exceeds 2^64 bits"},
        {"shape_wraps_to_4", tensor("U8", "1099511627776,1099511627776,4", "0,4"), "exceeds 2^64 bits"},
        {"bits_wrap", tensor("F64", "1099511627776,16777216", "0,0", 0), "exceeds 2^64 bits"},
        {"unknown_dtype_wraps", tensor("F31", "1099511627776,1099511627776", "0,4"), "exceeds 2^64 bits"},
        {"dtype_number", safetensors_bytes(R"({"a":{"dtype":32}})"), "expected dtype to be text, found the number 32"},
        {"dtype_empty", tensor("", "4", "0,4"), "'' is no dtype"},
        {"dtype_long", tensor(std::string(33, 'F'), "4", "0,4"), "is no dtype"},
    };
}

std::vector<Case> layout_cases()
{
    const std::string a = entry("a", "U8", "4", "0,4");
    return {
        {"one_byte_short", tensor("F32", "2", "0,7", 7), "F32 of shape [2] has 8 bytes, but data_offsets hold 7"},
        {"one_byte_long", tensor("F32", "2", "0,9", 9), "has 8 bytes, but data_offsets hold 9"},
        {"bytes_for_zero_dim", tensor("F32", "0,4", "0,4"), "F32 of shape [0, 4] has 0 bytes"},
        {"no_bytes_for_scalar", tensor("F32", "", "0,0", 0), "F32 of shape [] has 4 bytes, but data_offsets hold 0"},
        {"f4_odd", tensor("F4", "3", "0,2", 2), "no whole number of bytes"},
        {"f6_misaligned", tensor("F6_E2M3", "2", "0,2", 2), "no whole number of bytes"},
        {"f8_wrong_size", tensor("F8_E4M3", "4", "0,2", 2), "F8_E4M3 of shape [4] has 4 bytes"},
        {"c64_wrong_size", tensor("C64", "1", "0,4"), "C64 of shape [1] has 8 bytes"},
        {"past_the_end", tensor("U8", "8", "0,8"), "ends at byte 8 of 4 data bytes"},
        {"far_past_the_end", tensor("U8", "9007199254740992", "0,9007199254740992"), "dimension over 2^40"},
        {"unknown_dtype_past_the_end", tensor("Q4_K", "1", "0,8"), "ends at byte 8 of 4 data bytes"},
        {"unknown_dtype_hole", tensor("Q4_K", "1", "2,4"), "begins at data byte 2, expected 0: a hole"},
        {"cut_by_one", tensor("U8", "4", "0,4", 3), "ends at byte 4 of 3 data bytes"},
        {"one_trailing_byte", tensor("U8", "4", "0,4", 5), "1 bytes belong to nothing"},
        {"data_without_tensors", safetensors_bytes("{}", "x"), "1 bytes belong to nothing"},
        {"hole_at_start", tensor("U8", "4", "4,8", 8), "begins at data byte 4, expected 0: a hole"},
        {"hole_in_the_middle", tensors({a, entry("b", "U8", "4", "5,9")}, 9),
         "begins at data byte 5, expected 4: a hole"},
        {"overlap", tensors({a, entry("b", "U8", "4", "3,7")}, 7),
         "begins at data byte 3, expected 4: tensors overlap"},
        {"alias", tensors({a, entry("b", "U8", "4", "0,4")}, 4), "begins at data byte 0, expected 4: tensors overlap"},
        {"overlap_of_unsupported", tensors({a, entry("b", "C64", "1", "0,8")}, 8), "tensors overlap"},
        {"empty_tensor_in_the_middle", tensors({a, entry("b", "U8", "0", "2,2")}, 4), "begins at data byte 2"},
    };
}

TEST(SafetensorsReject, every_malformed_file_is_refused_with_its_own_words)
{
    const ScratchFolder folder;
    size_t count = 0;
    for (const auto& group : {length_cases(), json_cases(), name_cases(), number_cases(), layout_cases()})
        for (const Case& c : group) {
            SCOPED_TRACE(c.name);
            const auto result = Safetensors::open(folder.put("x.safetensors", c.file), c.limits);
            EXPECT_TRUE(says(result, c.error));
            if (!result) {
                EXPECT_EQ(result.error().code, ErrorCode::bad_input);
                EXPECT_NE(result.error().message.find("x.safetensors"), std::string::npos);
            }
            ++count;
        }
    EXPECT_GE(count, 90u);
}

TEST(SafetensorsReject, a_dtype_the_engine_does_not_read_is_refused_when_it_is_asked_for)
{
    const ScratchFolder folder;
    for (const auto& [dtype, shape] : std::vector<std::pair<const char*, const char*>>{
             {"C64", "1"}, {"F8_E4M3", "8"}, {"F4", "16"}, {"f32", "2"}, {"Q4_K", "7"}}) {
        const auto file = Safetensors::open(folder.put("x", tensor(dtype, shape, "0,8", 8)));
        ASSERT_TRUE(file) << dtype;
        EXPECT_EQ(file->find("a"), nullptr);
        EXPECT_EQ(file->unsupported().at(0).dtype, dtype);
        EXPECT_TRUE(says(file->get("a"), fmt::format("has dtype '{}', which is not supported", dtype)));
    }
}

TEST(SafetensorsReject, too_many_names_end_early)
{
    const ScratchFolder folder;
    std::string header = "{\"__metadata__\":{\"0\":\"\"";
    for (uint64_t i = 1; i <= kMaxMetadataEntries; ++i)
        header += fmt::format(R"(,"{}":"")", i);
    EXPECT_TRUE(says(Safetensors::open(folder.put("x", safetensors_bytes(header + "}}"))), "more than 65536 metadata"));
    header = "{";
    for (uint64_t i = 0; i <= kMaxTensors; ++i)
        header.append(i ? "," : "").append(entry(std::to_string(i), "U8", "0", "0,0"));
    EXPECT_TRUE(says(Safetensors::open(folder.put("x", safetensors_bytes(header + "}"))), "more than 65536 tensors"));
}

TEST(SafetensorsReject, a_file_cut_at_any_byte_or_with_any_byte_changed_never_crashes)
{
    const ScratchFolder folder;
    const std::string whole = tensors(
        {R"("__metadata__":{"k":"v"})", entry("a", "F16", "2,3", "0,12"), entry("b", "F8_E4M3", "4", "12,16")}, 16);
    for (size_t length = 0; length < whole.size(); ++length)
        EXPECT_FALSE(Safetensors::open(folder.put("x", whole.substr(0, length)))) << length;
    std::mt19937 random(7);
    for (int i = 0; i < 4000; ++i) {
        std::string changed = whole;
        for (unsigned n = random() % 3 + 1; n > 0; --n)
            changed[random() % changed.size()] = static_cast<char>(random());
        const auto file = Safetensors::open(folder.put("x", changed));
        if (!file) {
            EXPECT_EQ(file.error().message.find('\n'), std::string::npos);
            continue;
        }
        uint64_t sum = 0; // every byte that an accepted header names can be read
        for (const TensorInfo& t : file->tensors())
            for (const std::byte b : file->bytes(t))
                sum += std::to_integer<uint64_t>(b);
        EXPECT_LE(sum, 255u * 16u);
    }
}

} // namespace safetensors_reject_test
} // namespace semrover
