// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover doctor: one page on what works here, what is missing and how to get it
#include "engine/job/version.h"
#include "runtime/base/json.h"
#include "runtime/device/driver_gaps.h"
#include "runtime/device/loader.h"
#include "runtime/device/pipeline.h"
#include "runtime/system/process.h"
#include "tools/cli/commands.h"
#include "tools/cli/open_device.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/progress.h"

#include <CLI/CLI.hpp>
#include <cstdlib>

namespace semrover {

namespace {

// one line of the page
struct Finding {
    std::string what;
    bool ok = false;
    std::string text;    // what was found, or what cannot be done without it
    std::string package; // of Debian, what would mend it; may be empty
};

Finding loader_finding(const LoaderSummary& loader)
{
    return {"Vulkan loader", !loader.api.empty(), loader.api.empty() ? "does not answer" : loader.api, "libvulkan1"};
}

Finding driver_finding(const LoaderSummary& loader, bool works)
{
    if (loader.drivers.empty() && works) // Windows keeps them in its registry
        return {"Vulkan drivers", true, "known to the loader", ""};
    if (loader.drivers.empty())
        return {"Vulkan drivers", false, "none installed", "mesa-vulkan-drivers"};
    return {"Vulkan drivers", true, fmt::format("{}", fmt::join(loader.drivers, " ")), ""};
}

Finding validation_finding(const LoaderSummary& loader)
{
    return {"validation layer", loader.validation,
            loader.validation ? "installed (SEMROVER_VALIDATION=1 turns it on)"
                              : "tests and SEMROVER_VALIDATION need it",
            "vulkan-validationlayers"};
}

// a device that was asked for by name and is not there is no matter of packages
Finding device_finding(const Result<std::shared_ptr<Device>>& device, const std::string& asked)
{
    if (!device)
        return {"device", false, with_options(device.error().message), asked.empty() ? "mesa-vulkan-drivers" : ""};
    const Device& d = **device;
    const bool cpu = d.limits().type == DeviceType::cpu;
    return {"device", true, fmt::format("{}, {}{}", d.name(), d.driver(), cpu ? "; a CPU, so generating is slow" : ""),
            ""};
}

Finding cache_finding(Device& device)
{
    const std::string& file = device.pipelines().file();
    if (file.empty())
        return {"pipeline cache", true, "not kept: neither HOME nor XDG_CACHE_HOME is set", ""};
    std::error_code missing;
    const uint64_t bytes = std::filesystem::file_size(file, missing);
    return {"pipeline cache", true, fmt::format("{}, {}", file, missing ? "not written yet" : bytes_text(bytes)), ""};
}

Finding ffmpeg_finding()
{
    const bool found = system::on_path("ffmpeg");
    return {"ffmpeg", found, found ? "found" : "--video needs it", "ffmpeg"};
}

std::vector<Finding> gap_findings(const LoaderSummary& loader)
{
    std::vector<Finding> findings;
    for (const DriverGap& gap : find_driver_gaps(loader.drivers, "/", std::getenv))
        findings.push_back({"GPU driver", false, gap.text, gap.package});
    return findings;
}

void print_page(const std::vector<Finding>& findings)
{
    fmt::print("{}\n", kProgram);
    std::string packages;
    for (const Finding& f : findings) {
        fmt::print("{:7}  {:16}  {}\n", f.ok ? "ok" : "missing", f.what, f.text);
        if (!f.ok && !f.package.empty() && packages.find(f.package) == std::string::npos)
            packages += " " + f.package;
    }
    if (!packages.empty() && system::on_path("apt-get"))
        fmt::print("to mend it: apt-get install{}\n", packages);
}

void print_json(const std::vector<Finding>& findings)
{
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const Finding& f : findings) {
        list.push_back({{"what", f.what}, {"ok", f.ok}, {"text", f.text}});
        if (!f.ok && !f.package.empty())
            list.back()["package"] = f.package;
    }
    fmt::print("{}\n", json_text(nlohmann::ordered_json{{"version", kVersion}, {"findings", list}}, -1, true));
}

Status doctor(const Globals& globals)
{
    const LoaderSummary loader = describe_loader();
    const auto device = open_device(globals);
    std::vector<Finding> findings{loader_finding(loader), driver_finding(loader, device.has_value()),
                                  validation_finding(loader), device_finding(device, globals.device)};
    for (Finding& gap : gap_findings(loader))
        findings.push_back(std::move(gap));
    if (device)
        findings.push_back(cache_finding(**device));
    findings.push_back(ffmpeg_finding());
    globals.json ? print_json(findings) : print_page(findings);
    return device.map([](const auto&) {});
}

} // namespace

void add_doctor(CLI::App& app, const Globals& globals, Run& run)
{
    CLI::App* c = app.add_subcommand("doctor", "say what works here, what is missing and how to get it");
    c->callback([&globals, &run] { run = [&globals] { return doctor(globals); }; });
}

} // namespace semrover
