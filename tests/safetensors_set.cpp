// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/safetensors_bytes.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include "runtime/base/safetensors.h"

#include <gtest/gtest.h>

namespace semrover {
namespace safetensors_set_test {

constexpr const char* kIndexName = "m.safetensors.index.json";

// shards s1 (a: 1111) and s2 (b: 2222, c: 33)
void put_shards(const ScratchFolder& folder)
{
    folder.put("s1.safetensors", safetensors_bytes(header_of(entry("a", "U8", "4", "0,4")), "1111"));
    folder.put("s2.safetensors",
               safetensors_bytes(header_of(entry("b", "U8", "4", "0,4"), entry("c", "F8_E4M3", "2", "4,6")), "222233"));
}

Result<SafetensorsSet> open_index(const ScratchFolder& folder, std::string_view text)
{
    put_shards(folder);
    return SafetensorsSet::open(folder.put(kIndexName, text));
}

std::string map_to(std::string_view shard)
{
    return fmt::format(R"({{"weight_map":{{"a":"{}"}}}})", shard);
}

TEST(SafetensorsSet, an_index_joins_its_shards)
{
    const ScratchFolder folder;
    const auto set = open_index(folder, R"({"metadata":{"total_size":10,"format":"pt"},"weight_map":{
        "c":"s2.safetensors","b":"s2.safetensors","a":"s1.safetensors"}})");
    ASSERT_TRUE(set) << set.error().message;
    ASSERT_EQ(set->tensors().size(), 2u);
    EXPECT_EQ(std::to_integer<char>(set->bytes(*set->find("a"))[3]), '1');
    EXPECT_EQ(std::to_integer<char>(set->bytes(*set->find("b"))[0]), '2');
    EXPECT_EQ(set->unsupported().at(0).name, "c");
    EXPECT_EQ(set->shards().size(), 2u);
    EXPECT_TRUE(says(set->get("c"), "dtype 'F8_E4M3', which is not supported"));
    EXPECT_TRUE(says(set->get("d"), "there is no tensor 'd'"));
}

TEST(SafetensorsSet, an_index_cannot_name_a_file_elsewhere)
{
    const ScratchFolder folder;
    for (const char* shard : {"/etc/passwd", "/tmp/x.safetensors", "../s1.safetensors", "a/s1.safetensors",
                              "..\\\\s1.safetensors", ".safetensors", "s1.bin", "s1.safetensors.index.json", "",
                              "s 1.safetensors", "s1.safetensors\\u0000.safetensors", "gr\xc3\xbc.safetensors"})
        EXPECT_TRUE(says(open_index(folder, map_to(shard)), "tensor 'a': expected a file name such as")) << shard;
}

TEST(SafetensorsSet, an_index_that_contradicts_its_shards_is_refused)
{
    const ScratchFolder folder;
    EXPECT_TRUE(says(open_index(folder, map_to("s9.safetensors")), "No such file"));
    EXPECT_TRUE(
        says(open_index(folder, map_to("s2.safetensors")), "tensor 'b' of shard 's2.safetensors' is not in the index"));
    EXPECT_TRUE(says(open_index(folder, R"({"weight_map":{"a":"s1.safetensors","b":"s1.safetensors"}})"),
                     "tensor 'b' is not in shard 's1.safetensors'"));
    EXPECT_TRUE(says(open_index(folder, R"({"weight_map":{"a":"s1.safetensors","a":"s1.safetensors"}})"),
                     "key 'a' appears twice"));
    EXPECT_TRUE(says(open_index(folder, R"({"metadata":{"total_size":5},"weight_map":{"a":"s1.safetensors"}})"),
                     "expected total_size 5 bytes, found 4"));
    EXPECT_TRUE(says(open_index(folder, R"({"metadata":{"total_size":4.0},"weight_map":{"a":"s1.safetensors"}})"),
                     "expected total_size to be a whole number"));
    folder.put("s3.safetensors",
               safetensors_bytes(header_of(entry("a", "U8", "4", "0,4"), entry("d", "U8", "0", "4,4")), "3333"));
    EXPECT_TRUE(says(open_index(folder, R"({"weight_map":{"a":"s1.safetensors","d":"s3.safetensors"}})"),
                     "tensor 'a' belongs in shard 's1.safetensors', but is in 's3.safetensors' too"));
}

TEST(SafetensorsSet, an_index_of_another_form_is_refused)
{
    const ScratchFolder folder;
    for (const char* text : {"[]", "{}", "{\"weight_map\":[]}", "{\"weight_map\":{}}"})
        EXPECT_TRUE(says(open_index(folder, text), "expected an object with a weight_map")) << text;
    EXPECT_TRUE(says(open_index(folder, R"({"weight_map":{"a":7}})"), "expected a file name such as"));
    EXPECT_TRUE(says(open_index(folder, "{"), "not valid JSON"));
    std::string many = "{\"weight_map\":{\"0\":\"0.safetensors\"";
    for (int i = 1; i <= 10'000; ++i)
        many += fmt::format(R"(,"{0}":"{0}.safetensors")", i);
    EXPECT_TRUE(says(open_index(folder, many + "}}"), "more than 10000 shards"));
}

TEST(SafetensorsSet, a_folder_offers_its_half_precision_weights_first)
{
    const ScratchFolder folder;
    const std::string base = "diffusion_pytorch_model";
    EXPECT_TRUE(says(SafetensorsSet::open_folder(folder.path()), "found none"));
    put_shards(folder);
    folder.put(base + ".safetensors.index.json", map_to("s1.safetensors"));
    EXPECT_EQ(SafetensorsSet::open_folder(folder.path())->path().filename(), base + ".safetensors.index.json");
    folder.put(base + ".safetensors", safetensors_bytes("{}"));
    EXPECT_EQ(SafetensorsSet::open_folder(folder.path())->path().filename(), base + ".safetensors");
    folder.put(base + ".fp16.safetensors", safetensors_bytes("{}"));
    EXPECT_EQ(SafetensorsSet::open_folder(folder.path())->path().filename(), base + ".fp16.safetensors");
    EXPECT_TRUE(says(SafetensorsSet::open_folder(folder / "none"), "is no folder"));
    folder.put("conditioning.safetensors", safetensors_bytes("{}"));
    EXPECT_TRUE(SafetensorsSet::open_folder(folder.path(), "conditioning"));
}

TEST(SafetensorsSet, a_pickle_is_refused_with_the_way_to_convert_it)
{
    const ScratchFolder folder;
    for (const char* name : {"m.bin", "m.pt", "m.pth", "m.ckpt", "m.pkl"})
        EXPECT_TRUE(says(SafetensorsSet::open(folder.put(name, "x")), "convert it with Python")) << name;
    EXPECT_TRUE(says(SafetensorsSet::open_folder(folder.path()), "convert it with Python"));
}

TEST(SafetensorsSet, one_error_lists_everything_that_does_not_fit)
{
    const ScratchFolder folder;
    const std::string header = header_of(entry("bias", "F32", "1", "0,4"), entry("extra", "F16", "2", "4,8"),
                                         entry("good", "F16", "1,2", "8,12"), entry("odd", "F8_E4M3", "4", "12,16"),
                                         entry("whole", "I32", "1", "16,20"));
    const auto set =
        SafetensorsSet::open(folder.put("x.safetensors", safetensors_bytes(header, std::string(20, '\0'))));
    ASSERT_TRUE(set) << set.error().message;
    const std::vector<TensorSpec> schema = {{"bias", {3}},        {"weight", {4, 3}}, {"good", {1, 2}},   {"odd", {4}},
                                            {"maybe", {9}, true}, {"whole", {1}},     {"norm.weight", {}}};
    EXPECT_TRUE(
        says(set->require(schema),
             "x.safetensors': tensors do not fit the model; 2 missing: weight [4, 3], norm.weight []; 1 misshapen: "
             "bias expected [3] found [1]; 2 of an unsupported dtype: odd (F8_E4M3), whole (I32); 1 unexpected: "
             "extra [2]"));
    EXPECT_EQ(set->require(schema, Unexpected::ignore).error().message.find("extra"), std::string::npos);
    const std::vector<TensorSpec> fits = {
        {"bias", {1}}, {"good", {1, 2}}, {"extra", {2}}, {"whole", {1}, false, {DType::i32}}};
    EXPECT_TRUE(set->require(fits, Unexpected::ignore));
    EXPECT_TRUE(says(set->require(fits), "1 unexpected: odd [4]"));
}

TEST(SafetensorsSet, the_default_model_is_finite_and_a_nan_is_found)
{
    const auto model = SafetensorsSet::open_folder(SEMROVER_SOURCE_DIR "/assets/model/voxfield_transformer");
    ASSERT_TRUE(model) << model.error().message;
    EXPECT_TRUE(check_finite(*model));
    const ScratchFolder folder;
    const auto bad = SafetensorsSet::open(folder.put(
        "x.safetensors", safetensors_bytes(header_of(entry("w", "F16", "2", "0,4")), std::string("\0\0\0\x7c", 4))));
    EXPECT_TRUE(says(check_finite(*bad), "tensor 'w' holds NaN or infinity, first at element 1 of 2"));
}

} // namespace safetensors_set_test
} // namespace semrover
