// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover devices: the devices there are, what they can do, and which variant of each kernel they would run
#include "kernels/kernel_registry.h"
#include "runtime/base/json.h"
#include "runtime/device/device.h"
#include "runtime/graph/variant.h"
#include "tools/cli/commands.h"
#include "tools/cli/progress.h"

#include <CLI/CLI.hpp>
#include <cstdlib>

namespace semrover {

namespace {

using Report = nlohmann::ordered_json;

// op -> name of the variant; null when none runs there. Of ops with one variant only those that cannot run.
Report chosen_kernels(const DeviceLimits& limits)
{
    Report chosen = Report::object();
    for (const Kernel* kernel : kernel_registry()) {
        const KernelVariant* variant = choose_variant(*kernel, limits);
        const std::string op(kernel->name);
        if (!variant)
            chosen[op] = nullptr;
        else if (kernel->variants.size() > 1)
            chosen[op] = std::string(variant->name);
    }
    return chosen;
}

bool has_matrix_kernels()
{
    for (const Kernel* kernel : kernel_registry())
        for (const KernelVariant& variant : kernel->variants)
            if (variant.features & kFeatureCooperativeMatrix)
                return true;
    return false;
}

Report describe(const DeviceSummary& d)
{
    const DeviceLimits& l = d.limits;
    return {{"index", d.index},
            {"name", d.name},
            {"driver", d.driver},
            {"type", d.type},
            {"api", d.api},
            {"uuid", d.uuid},
            {"pci", d.pci},
            {"memory_bytes", d.memory_bytes},
            {"subgroup_size", l.subgroup_size},
            {"shared_bytes", l.max_shared_bytes},
            {"storage_range_bytes", l.max_storage_range},
            {"texel_elements", l.max_texel_elements},
            {"allocation_bytes", l.max_allocation},
            {"fp16", (l.features & kFeatureFloat16) != 0},
            {"extensions", d.extensions},
            {"kernels", chosen_kernels(l)},
            {"refusal", d.refusal}};
}

void print_text(const DeviceSummary& d)
{
    const DeviceLimits& l = d.limits;
    fmt::print("{}  {}  {}, Vulkan {}\n", d.index, d.name, d.type, d.api);
    if (!d.refusal.empty())
        fmt::print("   cannot be used  {}\n", d.refusal);
    fmt::print("   driver          {}\n", d.driver);
    fmt::print("   UUID            {}{}\n", d.uuid, d.pci.empty() ? "" : ", PCI " + d.pci);
    fmt::print("   memory          {}, {} in one allocation\n", bytes_text(d.memory_bytes),
               bytes_text(l.max_allocation));
    fmt::print("   buffers         {} of storage, {} texels\n", bytes_text(l.max_storage_range), l.max_texel_elements);
    fmt::print("   workgroups      subgroups of {}, {} of shared memory, {} threads\n", l.subgroup_size,
               bytes_text(l.max_shared_bytes), l.max_group_threads);
    fmt::print("   fp16            {}\n", l.features & kFeatureFloat16 ? "arithmetic and storage" : "storage only");
    fmt::print("   extensions      {}{}\n",
               d.extensions.empty() ? "none" : fmt::format("{}", fmt::join(d.extensions, " ")),
               has_matrix_kernels() ? "" : "; this build has no cooperative-matrix kernels");
    const Report chosen = chosen_kernels(l);
    std::string kernels;
    for (const auto& item : chosen.items())
        kernels += fmt::format("{}{} {}", kernels.empty() ? "" : ", ", item.key(),
                               item.value().is_null() ? "cannot run" : item.value().get<std::string>());
    fmt::print("   kernels         {}\n", kernels);
}

Status devices(const Globals& globals)
{
    SR_TRY(std::vector<DeviceSummary> all, list_devices());
    if (all.empty())
        return fail(ErrorCode::no_device, "no Vulkan device found; semrover doctor says what is missing");
    if (const char* lowered = std::getenv("SEMROVER_LIMITS"))
        for (DeviceSummary& d : all)
            SR_CHECK(override_limits(d.limits, lowered));
    Report list = Report::array();
    for (const DeviceSummary& d : all)
        list.push_back(describe(d));
    if (globals.json)
        fmt::print("{}\n", json_text(Report{{"devices", list}}, -1, true));
    else
        for (const DeviceSummary& d : all)
            print_text(d);
    return {};
}

} // namespace

void add_devices(CLI::App& app, const Globals& globals, Run& run)
{
    CLI::App* c = app.add_subcommand("devices", "list devices, their limits and the kernels chosen for them");
    c->callback([&globals, &run] { run = [&globals] { return devices(globals); }; });
}

} // namespace semrover
