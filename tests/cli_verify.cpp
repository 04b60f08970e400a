// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "runtime/base/json.h"
#include "runtime/base/safetensors.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"

#include <algorithm>
#include <cstring>
#include <gtest/gtest.h>

namespace semrover {
namespace cli_verify_test {

const std::string kGolden = SEMROVER_SOURCE_DIR "/tests/golden";

// a copy of the case whose first expected value is off by `error`
void put_case(const std::filesystem::path& folder, const std::string& name, float error)
{
    std::filesystem::copy(kGolden + "/" + name, folder);
    const auto file = Safetensors::open(folder / "tensors.safetensors");
    ASSERT_TRUE(file) << file.error().message;
    std::vector<TensorData> tensors;
    std::vector<std::vector<std::byte>> changed;
    for (const TensorInfo& t : file->tensors()) {
        const auto bytes = file->bytes(t);
        changed.emplace_back(bytes.begin(), bytes.end());
        float first;
        std::memcpy(&first, changed.back().data(), 4);
        first += error;
        if (t.name == "expect.states")
            std::memcpy(changed.back().data(), &first, 4);
        tensors.push_back({t.name, t.dtype, t.shape, changed.back()});
    }
    ASSERT_TRUE(write_safetensors(folder / "tensors.safetensors", tensors));
}

TEST(CliVerify, a_case_passes_with_its_error_and_tolerance_on_one_line)
{
    const ProgramResult result = semrover_program("verify " + kGolden + "/scheduler_ddim_sample/");
    EXPECT_EQ(result.code, 0) << result.err;
    EXPECT_TRUE(result.out.starts_with("PASS scheduler scheduler_ddim_sample ")) << result.out;
    EXPECT_TRUE(result.out.ends_with(" 1e-05\n")) << result.out;
}

// Golden cases, expected values as they are, networks as `convert` puts them in blocks. Tolerances are twice what was
// measured (docs/numerics.md §6.3), and above those of the case: without blocks it passes those, with blocks not
TEST(CliVerify, cases_stay_near_their_values_with_weights_of_8_bits)
{
    namespace fs = std::filesystem;
    struct Case {
        std::string name, part, component;
        double tolerance;
    };
    for (const Case& c : {Case{"transformer_wide", "model", "voxfield_transformer", 0.008},
                          Case{"asd_rollout_tiny", "model/unet", "renderer", 0.023}}) {
        const ScratchFolder folder;
        fs::copy(kGolden + "/" + c.name, folder / "case", fs::copy_options::recursive);
        fs::create_directories(folder / "in");
        fs::copy(folder / "case" / c.part, folder / "in" / c.component);
        if (fs::exists(folder / "case/model/vae"))
            fs::copy(folder / "case/model/vae", folder / "in/vae");
        const std::string in = (folder / "in").string(), out = (folder / "out").string();
        const ProgramResult converted = semrover_program("convert -q " + in + " " + out + " --weights q8_0");
        ASSERT_EQ(converted.code, 0) << converted.err;
        fs::remove_all(folder / "case" / c.part);
        fs::copy(folder / "out" / c.component, folder / "case" / c.part);
        Json json = *read_json(folder / "case/case.json");
        const double before = json["tolerance"]["fp32"];
        json["tolerance"]["fp32"] = c.tolerance;
        folder.put("case/case.json", json.dump());
        const ProgramResult result = semrover_program("verify " + (folder / "case").string());
        EXPECT_EQ(result.code, 0) << result.out << result.err;
        json["tolerance"]["fp32"] = before;
        folder.put("case/case.json", json.dump());
        EXPECT_EQ(semrover_program("verify " + (folder / "case").string()).code, 1) << "the weights are not in blocks";
    }
}

TEST(CliVerify, one_case_that_fails_makes_the_exit_code_1_and_the_rest_still_runs)
{
    const ScratchFolder folder;
    put_case(folder / "a_wrong", "scheduler_ddim_sample", 1);
    put_case(folder / "b_right", "scheduler_ddim_sample", 0);
    std::filesystem::create_directory(folder / "c_broken");
    folder.put("c_broken/case.json", R"({"kind":"scheduler","params":7})");
    folder.put("not_a_case", "");
    const ProgramResult result = semrover_program("verify " + folder.path().string());
    EXPECT_EQ(result.code, 1);
    EXPECT_EQ(result.err, "semrover: error: 2 of 3 cases failed\n");
    EXPECT_NE(result.out.find("FAIL scheduler a_wrong "), std::string::npos) << result.out;
    EXPECT_NE(result.out.find("PASS scheduler b_right "), std::string::npos) << result.out;
    EXPECT_NE(result.out.find("FAIL ? c_broken "), std::string::npos) << result.out;
}

TEST(CliVerify, parameters_of_the_wrong_type_fail_their_case_only)
{
    const ScratchFolder folder;
    put_case(folder / "typed", "scheduler_ddim_sample", 0);
    folder.put("typed/case.json",
               R"({"kind":"scheduler","params":{"type":[1],"num_inference_steps":4},"tolerance":{"fp32":1}})");
    const ProgramResult result = semrover_program("verify " + (folder / "typed").string());
    EXPECT_EQ(result.code, 1) << result.err;
    EXPECT_TRUE(result.out.starts_with("FAIL scheduler typed ")) << result.out;
}

TEST(CliVerify, a_kind_without_a_runner_is_skipped_and_said_in_summary_and_exit_code)
{
    const ScratchFolder folder;
    put_case(folder / "unknown", "scheduler_ddim_sample", 0);
    folder.put("unknown/case.json", R"({"kind":"novelty"})");
    const std::string cases = (folder / "unknown").string() + " " + kGolden + "/regions_paper";
    const ProgramResult result = semrover_program("verify --json --allow-skip " + cases);
    EXPECT_EQ(result.code, 0) << result.err;
    const auto report = json_of(result.out);
    EXPECT_EQ(report["passed"], 1);
    EXPECT_EQ(report["skipped"], 1);
    EXPECT_EQ(report["cases"][0]["outcome"], "SKIP");
    EXPECT_EQ(report["cases"][1]["kind"], "region_extraction");

    const ProgramResult strict = semrover_program("verify " + cases);
    EXPECT_EQ(strict.code, 7) << strict.err;
    EXPECT_TRUE(strict.out.ends_with("1 passed, 0 failed, 1 skipped\n")) << strict.out;
    EXPECT_NE(strict.err.find("1 of 2 cases were skipped"), std::string::npos) << strict.err;
    EXPECT_EQ(semrover_program("verify " + kGolden + "/regions_paper").code, 0);
}

TEST(CliVerify, a_folder_without_cases_is_refused)
{
    const ScratchFolder folder;
    EXPECT_EQ(semrover_program("verify " + folder.path().string()).code, 3);
    EXPECT_EQ(semrover_program("verify " + (folder / "none").string()).code, 3);
    EXPECT_EQ(semrover_program("verify").code, 2);
}

} // namespace cli_verify_test
} // namespace semrover
