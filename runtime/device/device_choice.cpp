// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/device_choice.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstdio>
#include <optional>

namespace semrover {

namespace {

using Devices = std::vector<const DeviceSummary*>;

constexpr uint32_t kNvidia = 0x10de, kAmd = 0x1002;

struct Variable {
    const char* name;
    uint32_t vendor; // whose GPUs its indices count, where there are any; 0: the discrete ones, where there are any
};
constexpr Variable kVariables[] = {{"SLURM_JOB_GPUS", 0},
                                   {"SLURM_STEP_GPUS", 0},
                                   {"CUDA_VISIBLE_DEVICES", kNvidia},
                                   {"ROCR_VISIBLE_DEVICES", kAmd},
                                   {"HIP_VISIBLE_DEVICES", kAmd}};

std::string list_of(const std::vector<DeviceSummary>& all)
{
    std::string text;
    for (const DeviceSummary& d : all) {
        text += fmt::format("{}{}: {} ({}", text.empty() ? "" : ", ", d.index, d.name, d.type);
        for (const auto& [what, value] : {std::pair{"UUID ", d.uuid}, {"PCI ", d.pci}, {"cannot be used: ", d.refusal}})
            if (!value.empty())
                text += fmt::format(", {}{}", what, value);
        text += ")";
    }
    return text;
}

bool is_gpu(const DeviceSummary& d)
{
    return d.type != "cpu";
}

bool is_number(std::string_view text)
{
    return !text.empty() && text.size() < 10 && text.find_first_not_of("0123456789") == text.npos;
}

std::string lower(std::string_view text)
{
    std::string out(text);
    std::ranges::transform(out, out.begin(), [](unsigned char c) { return char(std::tolower(c)); });
    return out;
}

// domain, bus, device and function of "0000:3b:00.0", "00000000:3B:00.0" or "3b:00.0"
using PciAddress = std::array<uint32_t, 4>;
std::optional<PciAddress> pci_address(const std::string& text)
{
    PciAddress a{};
    for (const bool domain : {true, false}) {
        int length = 0;
        if (domain)
            std::sscanf(text.c_str(), "%x:%x:%x.%x%n", &a[0], &a[1], &a[2], &a[3], &length);
        else
            std::sscanf(text.c_str(), "%x:%x.%x%n", &a[1], &a[2], &a[3], &length);
        if (length > 0 && size_t(length) == text.size())
            return a;
        a = {};
    }
    return std::nullopt;
}

// a whole UUID, or with GPU- before it any beginning
std::optional<std::string> uuid_beginning(std::string_view text)
{
    const bool prefixed = text.starts_with("GPU-");
    const std::string uuid = lower(prefixed ? text.substr(4) : text);
    if (uuid.empty() || uuid.find_first_not_of("0123456789abcdef-") != uuid.npos || (!prefixed && uuid.size() != 36))
        return std::nullopt;
    return uuid;
}

// the devices that a UUID or a PCI address names; nothing where `text` is neither
std::optional<Devices> identified(const Devices& among, const std::string& text)
{
    const auto uuid = uuid_beginning(text);
    const auto address = pci_address(text);
    if (!uuid && !address)
        return std::nullopt;
    Devices found;
    for (const DeviceSummary* d : among)
        if (uuid ? d->uuid.starts_with(*uuid) : pci_address(d->pci) == address && !d->pci.empty())
            found.push_back(d);
    return found;
}

// ---- what variables say

// "0,1", without spaces; ends where CUDA ends it
std::vector<std::string> words_of(std::string_view text)
{
    std::vector<std::string> words;
    while (!text.empty()) {
        const size_t comma = std::min(text.find(','), text.size());
        std::string word(text.substr(0, comma));
        std::erase(word, ' ');
        if (word == "-1" || word == "NoDevFiles" || word == "none")
            break;
        if (!word.empty())
            words.push_back(std::move(word));
        text.remove_prefix(std::min(comma + 1, text.size()));
    }
    return words;
}

// those that an index of the variable counts, in the order of PCI addresses
Devices counted_by(const Variable& variable, const Devices& gpus)
{
    Devices counted;
    for (const DeviceSummary* d : gpus)
        if (variable.vendor ? d->vendor == variable.vendor : d->type == "discrete")
            counted.push_back(d);
    if (counted.empty())
        counted = gpus;
    std::ranges::stable_sort(counted, {}, [](const DeviceSummary* d) { return pci_address(d->pci); });
    return counted;
}

Result<const DeviceSummary*> counted(const Devices& in_order, const std::string& word, const Variable& variable)
{
    uint32_t index = 0;
    std::from_chars(word.data(), word.data() + word.size(), index);
    if (index >= in_order.size())
        return fail(ErrorCode::no_device, "{} names GPU {}, and {} can be used", variable.name, word, in_order.size());
    for (const DeviceSummary* d : in_order)
        if (d->pci.empty() && in_order.size() > 1)
            return fail(ErrorCode::no_device, "{} names GPU {}, and the driver of '{}' does not say its PCI address",
                        variable.name, word, d->name);
    return in_order[index];
}

// The GPUs that a variable leaves to this process. A list of as many indices as there are GPUs means all of them: they
// may be of the machine, of which a container or a cgroup shows no others.
Result<Devices> named_by(const Variable& variable, const char* value, const Devices& gpus)
{
    const std::vector<std::string> words = words_of(value);
    const Devices in_order = counted_by(variable, gpus);
    if (std::ranges::all_of(words, is_number) && words.size() == in_order.size())
        return in_order;
    Devices named;
    for (const std::string& word : words) {
        if (is_number(word)) {
            if (gpus.size() == 1) // an index of the machine's
                return gpus;
            SR_TRY(const DeviceSummary* const one, counted(in_order, word, variable));
            named.push_back(one);
            continue;
        }
        const auto found = identified(gpus, word);
        if (!found && word.starts_with("MIG-"))
            return fail(ErrorCode::no_device, "{} names {}, a part of a GPU, which Vulkan does not know", variable.name,
                        word);
        if (!found)
            return fail(ErrorCode::no_device, "{}: expected an index, a UUID or a PCI address, found '{}'",
                        variable.name, word);
        if (found->empty())
            return fail(ErrorCode::no_device, "{} names {}, which is none of the GPUs that can be used", variable.name,
                        word);
        named.insert(named.end(), found->begin(), found->end());
    }
    return named;
}

// the GPUs that every variable leaves
Result<Devices> left_by_variables(const Devices& gpus, const Environment& environment)
{
    Devices left = gpus;
    std::string said;
    for (const Variable& variable : kVariables) {
        const char* value = environment(variable.name);
        if (!value)
            continue;
        said += fmt::format("{}{}='{}'", said.empty() ? "" : " and ", variable.name, value);
        SR_TRY(const Devices named, named_by(variable, value, gpus));
        const bool had_some = !left.empty();
        std::erase_if(left, [&](const DeviceSummary* d) { return std::ranges::find(named, d) == named.end(); });
        if (left.empty() && had_some && !named.empty())
            return fail(ErrorCode::no_device, "{} name no GPU in common", said);
    }
    return left;
}

Result<uint32_t> choose_by_environment(const std::vector<DeviceSummary>& all, bool require_gpu,
                                       const Environment& environment)
{
    Devices gpus;
    for (const DeviceSummary& d : all)
        if (d.refusal.empty() && is_gpu(d))
            gpus.push_back(&d);
    const auto left = left_by_variables(gpus, environment);
    if (!left)
        return fail(ErrorCode::no_device, "{}; there are: {}", left.error().message, list_of(all));
    if (left->size() == 1)
        return left->front()->index;
    if (left->size() > 1)
        return fail(ErrorCode::no_device,
                    "several GPUs, and no variable says which one is for this process; set "
                    "`device` to the index, UUID or PCI address of one: {}",
                    list_of(all));
    const auto other = std::ranges::find_if(all, [](const auto& d) { return d.refusal.empty() && !is_gpu(d); });
    if (other != all.end() && !require_gpu)
        return other->index;
    return fail(ErrorCode::no_device, "{}; there are: {}",
                gpus.empty() ? "a GPU is required (`require`), and none can be used"
                             : "variables such as CUDA_VISIBLE_DEVICES leave no GPU to this process",
                list_of(all));
}

// ---- what `device` says

Devices matching(const std::vector<DeviceSummary>& all, const std::string& select)
{
    Devices devices;
    for (const DeviceSummary& d : all)
        devices.push_back(&d);
    if (auto found = identified(devices, select); found && !found->empty())
        return *found;
    std::erase_if(devices, [&](const DeviceSummary* d) {
        return is_number(select) ? std::to_string(d->index) != select : d->name.find(select) == std::string::npos;
    });
    return devices;
}

Result<uint32_t> choose_by_name(const std::vector<DeviceSummary>& all, const std::string& select)
{
    for (const DeviceSummary* d : matching(all, select)) {
        if (d->refusal.empty())
            return d->index;
        if (!select.empty())
            return fail(ErrorCode::no_device, "device '{}' cannot be used: {}", d->name, d->refusal);
    }
    return fail(ErrorCode::no_device, "no usable device matches '{}'; there are: {}", select, list_of(all));
}

} // namespace

Result<uint32_t> choose_device(const std::vector<DeviceSummary>& all, const std::string& select, bool require_gpu,
                               const Environment& environment)
{
    if (all.empty())
        return fail(ErrorCode::no_device, "no Vulkan device found; install a driver (Debian: mesa-vulkan-drivers)");
    SR_TRY(const uint32_t index,
           select == "auto" ? choose_by_environment(all, require_gpu, environment) : choose_by_name(all, select));
    if (require_gpu && !is_gpu(all[index]))
        return fail(ErrorCode::no_device, "a GPU is required (`require`), found a CPU; there are: {}", list_of(all));
    return index;
}

bool is_under_engine(const Environment& environment)
{
    return std::ranges::any_of(
        std::array{"SLURM_JOB_ID", "JOB_COMPLETION_INDEX", "AWS_BATCH_JOB_ARRAY_INDEX", "KUBERNETES_SERVICE_HOST"},
        [&](const char* name) { return environment(name) != nullptr; });
}

} // namespace semrover
