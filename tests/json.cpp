// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/json.h"

#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <gtest/gtest.h>

namespace semrover {
namespace json_test {

TEST(Json, a_document_becomes_the_value_it_says)
{
    const char* text = R"( {"a":[1,-2,3.5,"x",null,true],"b":{"a":{}, "c":[[]]}} )";
    EXPECT_EQ(parse_json(text, "t").value(), Json::parse(text));
    EXPECT_EQ(parse_json("7", "t").value(), Json(7));
}

TEST(Json, duplicate_keys_are_refused_at_every_level)
{
    EXPECT_TRUE(says(parse_json(R"({"a":1,"a":1})", "t"), "t: key 'a' appears twice"));
    EXPECT_TRUE(says(parse_json(R"([{"b":{"k":1,"\u006b":2}}])", "t"), "key 'k' appears twice"));
    EXPECT_TRUE(parse_json(R"([{"k":1},{"k":2}])", "t"));
}

TEST(Json, broken_text_is_refused_with_the_place)
{
    EXPECT_TRUE(says(parse_json("", "t"), "not valid JSON at byte 1"));
    EXPECT_TRUE(says(parse_json("{\"a\":1", "t"), "not valid JSON at byte 7"));
    EXPECT_TRUE(says(parse_json("{} x", "t"), "not valid JSON at byte 4"));
    EXPECT_TRUE(says(parse_json("\xef\xbb\xbf{}", "t"), "byte order mark"));
    EXPECT_TRUE(says(parse_json(std::string_view("{}\0x", 4), "t"), "NUL at byte 2"));
    EXPECT_TRUE(says(parse_json("\"\xff\"", "t"), "ill-formed UTF-8"));
    EXPECT_TRUE(says(parse_json("1e999", "t"), "number overflow"));
    EXPECT_TRUE(says(parse_json("[NaN]", "t"), "not valid JSON"));
    EXPECT_TRUE(says(parse_json("[1,]", "t"), "not valid JSON"));
    EXPECT_TRUE(says(parse_json("/* c */ 1", "t"), "not valid JSON"));
}

TEST(Json, limits_hold_for_depth_values_and_bytes)
{
    EXPECT_TRUE(parse_json(std::string(32, '[') + std::string(32, ']'), "t"));
    EXPECT_TRUE(says(parse_json(std::string(1000000, '['), "t"), "nested deeper than 32"));
    EXPECT_TRUE(says(parse_json("[1,2,3]", "t", {.values = 3}), "more than 3 values"));
    EXPECT_TRUE(says(parse_json("[1,2,3]", "t", {.bytes = 6}), "at most 6 bytes"));
}

TEST(Json, values_of_an_array_come_one_by_one)
{
    Json all = Json::array();
    const auto keep = [&](const Json& value, size_t number) -> Status {
        EXPECT_EQ(number, all.size());
        all.push_back(value);
        return {};
    };
    const char* text = R"([{"a": [1, {"b": []}], "c": null}, 7, [], [[2], true], "x", -1, 1.5, {}])";
    ASSERT_TRUE(parse_json_records(text, "t", {.depth = 4, .values = 6}, keep));
    EXPECT_EQ(all, Json::parse(text));
    all = Json::array();
    EXPECT_TRUE(parse_json_records("[]", "t", {}, keep));
    EXPECT_TRUE(all.empty());
    EXPECT_TRUE(says(parse_json_records(text, "t", {.depth = 2}, keep), "t: value 0: nested deeper than 2"));
    EXPECT_TRUE(says(parse_json_records("[[1, 2, 3], 4]", "t", {.values = 3}, [](auto&&...) { return Status(); }),
                     "value 0: more than 3 values"));
    all = Json::array();
    EXPECT_TRUE(says(parse_json_records(R"([1, {"k": 1, "k": 2}])", "t", {}, keep), "value 1: key 'k' appears twice"));
    EXPECT_EQ(all.size(), 1u);
    for (const char* other : {"{}", "7", "null", "{\"a\": []}"})
        EXPECT_TRUE(says(parse_json_records(other, "t", {}, keep), "t: expected an array")) << other;
    for (const char* broken : {"", "[", "[1", "[1]]", "[1] 2", "[{\"a\""}) {
        all = Json::array();
        EXPECT_TRUE(says(parse_json_records(broken, "t", {}, keep), "not valid JSON")) << broken;
    }
    EXPECT_TRUE(says(parse_json_records("[1]", "t", {.bytes = 2}, keep), "at most 2 bytes"));
    size_t calls = 0;
    EXPECT_TRUE(says(parse_json_records("[1, 2, 3]", "t", {},
                                        [&](const Json&, size_t) -> Status {
                                            if (++calls == 2)
                                                return fail(ErrorCode::bad_input, "enough");
                                            return {};
                                        }),
                     "enough"));
    EXPECT_EQ(calls, 2u);
}

TEST(Json, a_file_is_read_and_named_in_its_error)
{
    const ScratchFolder folder;
    EXPECT_EQ(read_json(folder.put("good.json", "[1]")).value(), Json::array({1}));
    EXPECT_TRUE(says(read_json(folder.put("bad.json", "[1")), "bad.json': not valid JSON"));
    EXPECT_EQ(read_json(folder.put("windows.json", "\xef\xbb\xbf[1]")).value(), Json::array({1}));
    EXPECT_TRUE(says(read_json(folder.put("wide.json", std::string("\xff\xfe[\0", 4))), "UTF-16"));
    EXPECT_TRUE(says(read_json(folder / "none.json"), "No such file"));
}

} // namespace json_test
} // namespace semrover
