// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "kernels/kernel_registry.h"
#include "runtime/base/json.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <set>

namespace semrover {
namespace cli_devices_test {

using Json = nlohmann::json;

TEST(Catalogue, has_every_op_of_the_shaders_once)
{
    std::set<std::string> ops;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(SEMROVER_SOURCE_DIR "/shaders")) {
        const std::string file = entry.path().filename().string();
        const bool of_bench =
            entry.path().parent_path().filename() == "bench"; // measures a device, is no op of a graph
        if (entry.path().extension() == ".comp" && !of_bench)
            ops.insert(file.substr(0, file.find('.')));
    }
    std::set<std::string> found;
    for (const Kernel* kernel : kernel_registry())
        EXPECT_TRUE(found.emplace(kernel->name).second) << kernel->name;
    EXPECT_EQ(found, ops);
}

void expect_refusal(const std::string& arguments)
{
    const ProgramResult refused = semrover_program(arguments);
    EXPECT_EQ(refused.code, 4) << arguments;
    EXPECT_EQ(std::ranges::count(refused.err, '\n'), 1) << refused.err;
    EXPECT_NE(refused.err.find("GPU"), std::string::npos) << refused.err;
    EXPECT_NE(refused.err.find("(cpu, UUID "), std::string::npos) << refused.err;
}

TEST(CliDevices, every_device_is_listed_with_limits_and_kernels)
{
    const ProgramResult text = semrover_program("devices");
    ASSERT_EQ(text.code, 0) << text.err;
    const Json devices = json_of(semrover_program("devices --json").out)["devices"];
    ASSERT_FALSE(devices.empty());
    for (size_t i = 0; i < devices.size(); ++i) {
        EXPECT_EQ(devices[i]["index"], i);
        EXPECT_GT(devices[i]["storage_range_bytes"], 0);
        EXPECT_NE(text.out.find(devices[i]["name"]), std::string::npos) << text.out;
        EXPECT_EQ(devices[i]["uuid"].get<std::string>().size(), 36u);
        EXPECT_NE(text.out.find(devices[i]["uuid"]), std::string::npos) << text.out;
        EXPECT_TRUE(devices[i]["pci"].is_string());
        EXPECT_TRUE(devices[i]["kernels"]["gemm"].is_string());
        EXPECT_TRUE(devices[i]["kernels"]["attention"].is_string());
    }
}

TEST(CliDevices, tiles_of_matrix_units_are_refused_where_there_are_none)
{
    setenv("SEMROVER_LIMITS", "coopmat=0", 1);
    const ProgramResult refused = semrover_program("bench tiles --divide 256 --seconds 0");
    unsetenv("SEMROVER_LIMITS");
    EXPECT_EQ(refused.out, "");
    expect_error(refused, 4, "tiles are of matrix units (VK_KHR_cooperative_matrix), which it has not");
}

TEST(CliDevices, limits_that_a_test_lowers_are_the_ones_shown)
{
    setenv("SEMROVER_LIMITS", "shared=16384,variant=simt", 1);
    const Json device = json_of(semrover_program("devices --json").out)["devices"][0];
    unsetenv("SEMROVER_LIMITS");
    EXPECT_EQ(device["shared_bytes"], 16384);
    EXPECT_EQ(device["kernels"]["gemm"], "simt");
}

TEST(CliDoctor, a_machine_that_runs_tests_has_all_it_needs)
{
    const ProgramResult result = semrover_program("doctor --json");
    ASSERT_EQ(result.code, 0) << result.err;
    const Json report = json_of(result.out);
    for (const Json& finding : report["findings"])
        EXPECT_TRUE(finding["ok"]) << finding;
    EXPECT_EQ("semrover " + report["version"].get<std::string>() + "\n", semrover_program("--version").out);
}

TEST(CliDoctor, without_a_driver_it_says_what_to_install_and_exits_with_4)
{
    setenv("VK_ICD_FILENAMES", "/nonexistent.json", 1);
    const ProgramResult doctor = semrover_program("doctor"), devices = semrover_program("devices");
    unsetenv("VK_ICD_FILENAMES");
    EXPECT_EQ(doctor.code, 4);
    EXPECT_NE(doctor.out.find("apt-get install mesa-vulkan-drivers"), std::string::npos) << doctor.out;
    EXPECT_EQ(std::ranges::count(doctor.err, '\n'), 1);
    EXPECT_EQ(devices.code, 4);
    EXPECT_EQ(devices.out, "");
}

// a variable for the programs that a test starts
struct Variable {
    const char* name;
    Variable(const char* name, const char* value) : name(name) { setenv(name, value, 1); }
    ~Variable() { unsetenv(name); }
};

TEST(CliDevices, under_an_engine_a_cpu_is_never_taken_in_silence)
{
    const Variable only_a_cpu("CUDA_VISIBLE_DEVICES", ""); // whatever else this machine has
    EXPECT_EQ(semrover_program("doctor --device auto").code, 0);
    EXPECT_EQ(semrover_program("doctor --device auto --require any").code, 0);
    expect_refusal("doctor --device auto --require gpu");
    for (const char* engine :
         {"SLURM_JOB_ID", "JOB_COMPLETION_INDEX", "AWS_BATCH_JOB_ARRAY_INDEX", "KUBERNETES_SERVICE_HOST"}) {
        const Variable variable(engine, "1");
        expect_refusal("doctor");
        EXPECT_EQ(semrover_program("doctor --require any").code, 0) << engine;
    }
    EXPECT_EQ(semrover_program("doctor --require cuda").code, 2);
}

} // namespace cli_devices_test
} // namespace semrover
