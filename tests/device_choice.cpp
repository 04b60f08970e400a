// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// which of a machine's devices a process takes, by what an engine's variables say; no device is asked
#include "runtime/device/device_choice.h"

#include "tests/support/says.h"

#include <map>

namespace semrover {
namespace device_choice_test {

using Variables = std::map<std::string, std::string>;

Environment environment(const Variables& variables)
{
    return [&variables](const char* name) -> const char* {
        const auto found = variables.find(name);
        return found == variables.end() ? nullptr : found->second.c_str();
    };
}

DeviceSummary device(const char* name, const char* type, const char* uuid, const char* pci, uint32_t vendor)
{
    DeviceSummary d;
    d.name = name;
    d.type = type;
    d.uuid = uuid;
    d.pci = pci;
    d.vendor = vendor;
    return d;
}

using Machine = std::vector<DeviceSummary>;

Machine machine(std::initializer_list<DeviceSummary> devices)
{
    Machine all(devices);
    for (size_t i = 0; i < all.size(); ++i)
        all[i].index = uint32_t(i);
    return all;
}

const DeviceSummary kCpu = device("llvmpipe", "cpu", "6d657361-0000-0000-0000-000000000000", "", 0x10005);
// Vulkan lists them in another order than that of their addresses
const DeviceSummary kA = device("H200", "discrete", "aaaaaaaa-1111-2222-3333-444444444444", "0000:1b:00.0", 0x10de),
                    kB = device("H200", "discrete", "aaaabbbb-1111-2222-3333-444444444444", "0000:43:00.0", 0x10de),
                    kC = device("H200", "discrete", "cccccccc-1111-2222-3333-444444444444", "0001:04:00.0", 0x10de);
const DeviceSummary kAmdX = device("MI210", "discrete", "00000000-0300-0000-0000-000000000000", "0000:03:00.0", 0x1002),
                    kAmdY = device("MI210", "discrete", "00000000-0400-0000-0000-000000000000", "0000:c4:00.0", 0x1002);
const DeviceSummary kOfTheBoard =
    device("UHD", "integrated", "80868086-0000-0000-0000-000000000000", "0000:00:02.0", 0x8086);
// indices of the list: 0 is the last by address
const Machine kThree = machine({kC, kA, kB, kCpu}), kOne = machine({kB, kCpu}), kNone = machine({kCpu}),
              kMixed = machine({kAmdY, kC, kAmdX, kA, kOfTheBoard, kCpu});

struct Case {
    const Machine& machine;
    Variables variables;
    uint32_t index;
};

TEST(device_choice, auto_takes_the_one_gpu_that_variables_leave)
{
    const Case cases[] = {
        // one GPU, whatever index it has outside this container
        {kOne, {}, 0},
        {kOne, {{"CUDA_VISIBLE_DEVICES", "0"}}, 0},
        {kOne, {{"SLURM_JOB_GPUS", "5"}}, 0},
        {kOne, {{"SLURM_JOB_GPUS", "5,6"}, {"CUDA_VISIBLE_DEVICES", "0"}}, 0},
        {kOne, {{"CUDA_VISIBLE_DEVICES", "GPU-aaaabbbb-1111-2222-3333-444444444444"}}, 0},
        // indices go by PCI address
        {kThree, {{"CUDA_VISIBLE_DEVICES", "0"}}, 1},
        {kThree, {{"CUDA_VISIBLE_DEVICES", "1"}}, 2},
        {kThree, {{"CUDA_VISIBLE_DEVICES", "2"}}, 0},
        {kThree, {{"CUDA_VISIBLE_DEVICES", " 2 , "}}, 0},
        {kThree, {{"CUDA_VISIBLE_DEVICES", "1,-1,0"}}, 2}, // CUDA sees what is before -1
        {kThree, {{"SLURM_JOB_GPUS", "2"}}, 0},
        {kThree, {{"SLURM_STEP_GPUS", "1"}}, 2},
        // UUIDs and their beginnings, addresses
        {kThree, {{"CUDA_VISIBLE_DEVICES", "GPU-cccccccc-1111-2222-3333-444444444444"}}, 0},
        {kThree, {{"CUDA_VISIBLE_DEVICES", "GPU-AAAAB"}}, 2},
        {kThree, {{"CUDA_VISIBLE_DEVICES", "cccccccc-1111-2222-3333-444444444444"}}, 0},
        {kThree, {{"CUDA_VISIBLE_DEVICES", "0000:1B:00.0"}}, 1},
        {kThree, {{"CUDA_VISIBLE_DEVICES", "00000000:43:00.0"}}, 2},
        {kThree, {{"CUDA_VISIBLE_DEVICES", "1b:00.0"}}, 1},
        {kThree, {{"CUDA_VISIBLE_DEVICES", "0001:04:00.0"}}, 0},
        // several variables: what all of them leave
        {kThree, {{"SLURM_JOB_GPUS", "0,2"}, {"CUDA_VISIBLE_DEVICES", "2"}}, 0},
        {kThree, {{"SLURM_JOB_GPUS", "0,1"}, {"SLURM_STEP_GPUS", "1"}, {"CUDA_VISIBLE_DEVICES", "GPU-aaaabbbb"}}, 2},
        {kThree, {{"SLURM_JOB_GPUS", "0,1"}, {"CUDA_VISIBLE_DEVICES", "1,2"}}, 2},
        // as many as can be seen: those of the machine, of which a cgroup shows these only
        {kThree, {{"SLURM_JOB_GPUS", "3,5,7"}, {"CUDA_VISIBLE_DEVICES", "1"}}, 2},
        // an index counts the GPUs of the variable's maker
        {kMixed, {{"CUDA_VISIBLE_DEVICES", "1"}}, 1},
        {kMixed, {{"ROCR_VISIBLE_DEVICES", "1"}}, 0},
        {kMixed, {{"HIP_VISIBLE_DEVICES", "0"}, {"ROCR_VISIBLE_DEVICES", "0"}}, 2},
        {kMixed, {{"SLURM_JOB_GPUS", "1"}}, 3}, // of the discrete ones
        // no GPU: a CPU, where none is required
        {kNone, {}, 0},
        {kThree, {{"CUDA_VISIBLE_DEVICES", ""}}, 3},
        {kThree, {{"CUDA_VISIBLE_DEVICES", "NoDevFiles"}}, 3},
        {kOne, {{"ROCR_VISIBLE_DEVICES", "-1"}}, 1},
    };
    for (const Case& c : cases) {
        const auto chosen = choose_device(c.machine, "auto", false, environment(c.variables));
        std::string said;
        for (const auto& [name, value] : c.variables)
            said += name + "=" + value + " ";
        if (chosen)
            EXPECT_EQ(*chosen, c.index) << said;
        else
            ADD_FAILURE() << said << chosen.error().message;
    }
}

struct Refusal {
    const Machine& machine;
    Variables variables;
    const char* text;
};

TEST(device_choice, what_cannot_be_decided_is_an_error_with_the_list)
{
    const Machine nameless =
        machine({device("Apple", "integrated", "0", "", 0x106b), device("Eve", "other", "1", "", 1)});
    const Refusal cases[] = {
        {kThree, {}, "several GPUs, and no variable says which"},
        {kThree, {{"CUDA_VISIBLE_DEVICES", "0,1"}}, "several GPUs"},
        {kThree, {{"SLURM_JOB_GPUS", "0,1,2"}}, "several GPUs"},
        {kThree, {{"CUDA_VISIBLE_DEVICES", "3"}}, "CUDA_VISIBLE_DEVICES names GPU 3, and 3 can be used"},
        {kThree, {{"CUDA_VISIBLE_DEVICES", "-2"}}, "CUDA_VISIBLE_DEVICES: expected an index, a UUID or a PCI address"},
        {kThree, {{"CUDA_VISIBLE_DEVICES", "first"}}, "found 'first'"},
        {kThree, {{"CUDA_VISIBLE_DEVICES", "GPU-aaaa"}}, "several GPUs"},
        {kThree, {{"CUDA_VISIBLE_DEVICES", "GPU-dddd"}}, "names GPU-dddd, which is none of the GPUs"},
        {kThree, {{"CUDA_VISIBLE_DEVICES", "0000:44:00.0"}}, "names 0000:44:00.0, which is none"},
        {kThree, {{"CUDA_VISIBLE_DEVICES", "MIG-12345678"}}, "a part of a GPU"},
        {kOne, {{"CUDA_VISIBLE_DEVICES", "MIG-GPU-aaaabbbb/1/0"}, {"SLURM_JOB_GPUS", "3"}}, "a part of a GPU"},
        {kOne, {{"CUDA_VISIBLE_DEVICES", "GPU-aaaaaaaa"}}, "none of the GPUs"}, // another process's, which failed here
        {kThree,
         {{"SLURM_JOB_GPUS", "1"}, {"CUDA_VISIBLE_DEVICES", "2"}},
         "SLURM_JOB_GPUS='1' and CUDA_VISIBLE_DEVICES='2' name no GPU in common"},
        {nameless, {{"SLURM_JOB_GPUS", "1"}}, "does not say its PCI address"},
        {kMixed, {{"CUDA_VISIBLE_DEVICES", "0"}, {"ROCR_VISIBLE_DEVICES", "0"}}, "name no GPU in common"},
    };
    for (const Refusal& c : cases) {
        const auto chosen = choose_device(c.machine, "auto", false, environment(c.variables));
        EXPECT_TRUE(says(chosen, c.text));
        EXPECT_EQ(chosen.error().code, ErrorCode::no_device);
        EXPECT_TRUE(says(chosen, c.machine.front().name));
    }
    EXPECT_TRUE(says(choose_device(kThree, "auto", false, environment({})),
                     "0: H200 (discrete, UUID cccccccc-1111-2222-3333-444444444444, PCI 0001:04:00.0), 1: H200 ("));
}

TEST(device_choice, a_device_that_cannot_be_used_is_not_counted_and_shown_with_the_reason)
{
    Machine all = kThree;
    all[1].refusal = "needs Vulkan 1.2, has 1.1";
    EXPECT_EQ(*choose_device(all, "auto", false, environment({{"CUDA_VISIBLE_DEVICES", "0"}})), 2u);
    EXPECT_TRUE(says(choose_device(all, "auto", false, environment({})), "cannot be used: needs Vulkan 1.2, has 1.1"));
}

TEST(device_choice, a_name_an_index_a_uuid_and_an_address_choose_one)
{
    const Variables nobody = {{"CUDA_VISIBLE_DEVICES", "0"}}; // is not asked
    const std::pair<const char*, uint32_t> cases[] = {
        {"", 0}, {"2", 2}, {"H200", 0}, {"llvm", 3}, {"43:00.0", 2}, {"0001:04:00.0", 0}, {"GPU-aaaabbbb", 2}};
    for (const auto& [select, index] : cases)
        EXPECT_EQ(*choose_device(kThree, select, false, environment(nobody)), index) << select;
    EXPECT_EQ(*choose_device(kThree, kA.uuid, false, environment(nobody)), 1u);
    EXPECT_TRUE(says(choose_device(kThree, "17", false, environment(nobody)), "no usable device matches '17'"));
    EXPECT_TRUE(says(choose_device({}, "auto", false, environment(nobody)), "no Vulkan device found"));
}

TEST(device_choice, where_a_gpu_is_required_a_cpu_is_an_error_that_says_what_was_found)
{
    for (const char* select : {"", "auto", "0", "llvmpipe"}) {
        const auto chosen = choose_device(kNone, select, true, environment({}));
        EXPECT_TRUE(says(chosen, "a GPU is required (`require`)")) << select;
        EXPECT_TRUE(says(chosen, "0: llvmpipe (cpu, UUID")) << select;
        EXPECT_EQ(chosen.error().code, ErrorCode::no_device);
    }
    EXPECT_TRUE(says(choose_device(kThree, "auto", true, environment({{"CUDA_VISIBLE_DEVICES", ""}})),
                     "leave no GPU to this process"));
    EXPECT_EQ(*choose_device(kOne, "", true, environment({})), 0u);
}

TEST(device_choice, engines_are_known_by_their_variables)
{
    EXPECT_FALSE(is_under_engine(environment({{"SLURM_CONF", "x"}, {"CUDA_VISIBLE_DEVICES", "0"}})));
    for (const char* name :
         {"SLURM_JOB_ID", "JOB_COMPLETION_INDEX", "AWS_BATCH_JOB_ARRAY_INDEX", "KUBERNETES_SERVICE_HOST"})
        EXPECT_TRUE(is_under_engine(environment({{name, "0"}}))) << name;
}

} // namespace device_choice_test
} // namespace semrover
