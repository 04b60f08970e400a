// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/loader.h"

#include "runtime/device/physical_device.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <sstream>

namespace semrover {

namespace {

namespace fs = std::filesystem;

// the variables replace the folders (Vulkan-Loader, LoaderDriverInterface.md)
std::vector<std::string> driver_manifests()
{
    std::vector<std::string> found;
    for (const char* variable : {"VK_DRIVER_FILES", "VK_ICD_FILENAMES"})
        if (const char* value = std::getenv(variable)) {
            std::stringstream list(value);
            for (std::string file; std::getline(list, file, ':');)
                found.push_back(file);
            return found;
        }
    for (const char* folder : {"/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/usr/share/vulkan/icd.d"}) {
        std::error_code missing;
        for (const auto& entry : fs::directory_iterator(folder, missing))
            if (entry.path().extension() == ".json")
                found.push_back(entry.path().string());
    }
    std::ranges::sort(found);
    return found;
}

bool layer_installed(const char* name)
{
    uint32_t count = 0;
    if (vkEnumerateInstanceLayerProperties(&count, nullptr) != VK_SUCCESS)
        return false;
    std::vector<VkLayerProperties> layers(count);
    if (vkEnumerateInstanceLayerProperties(&count, layers.data()) != VK_SUCCESS)
        return false;
    return std::ranges::any_of(layers, [&](const auto& l) { return !std::strcmp(l.layerName, name); });
}

} // namespace

LoaderSummary describe_loader()
{
    LoaderSummary s;
    uint32_t version = 0;
    if (vkEnumerateInstanceVersion(&version) == VK_SUCCESS)
        s.api = api_version_text(version);
    s.drivers = driver_manifests();
    s.validation = layer_installed(kValidationLayer);
    return s;
}

} // namespace semrover
