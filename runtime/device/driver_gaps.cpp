// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/driver_gaps.h"

#include <algorithm>
#include <fstream>
#include <sstream>

namespace semrover {

namespace {

namespace fs = std::filesystem;

constexpr const char* kLibraryFolders[] = {
    "lib",   "usr/lib",   "usr/local/lib",         "lib/x86_64-linux-gnu",     "usr/lib/x86_64-linux-gnu",
    "lib64", "usr/lib64", "lib/aarch64-linux-gnu", "usr/lib/aarch64-linux-gnu"};

struct Library {
    const char *file, *package;
};
// what NVIDIA's driver opens, and its container tools do not bring
constexpr Library kOfNvidia[] = {{"libX11.so.6", "libx11-6"}, {"libXext.so.6", "libxext6"}, {"libEGL.so.1", "libegl1"}};

// makers whose GPUs Mesa drives, as sys names them; of others' device files, such as virtual machines', nobody knows
struct MesaDriver {
    const char *vendor, *maker, *manifest;
};
constexpr MesaDriver kOfMesa[] = {{"0x1002", "AMD", "radeon"}, {"0x8086", "Intel", "intel"}};

// "dev/nvidia0", the first that begins so and goes on with a digit; empty where there is none
std::string first_numbered(const fs::path& root, const std::string& beginning)
{
    std::string first;
    std::error_code missing;
    for (const auto& entry : fs::directory_iterator((root / beginning).parent_path(), missing)) {
        const std::string path = entry.path().lexically_relative(root).string();
        const bool numbered = path.starts_with(beginning) && path.size() > beginning.size() &&
                              path.find_first_not_of("0123456789", beginning.size()) == path.npos;
        if (numbered && (first.empty() || path < first))
            first = path;
    }
    return first;
}

bool has_manifest(const std::vector<std::string>& manifests, const char* name)
{
    return std::ranges::any_of(manifests, [&](const std::string& path) {
        return fs::path(path).filename().string().find(name) != std::string::npos;
    });
}

bool is_of_a_cpu(const std::string& manifest)
{
    return has_manifest({manifest}, "lvp") || has_manifest({manifest}, "swiftshader");
}

bool has_library(const fs::path& root, const char* file, const Environment& environment)
{
    std::error_code missing;
    for (const char* folder : kLibraryFolders)
        if (fs::exists(root / folder / file, missing))
            return true;
    const char* more = environment("LD_LIBRARY_PATH");
    std::stringstream folders(more ? more : "");
    for (std::string folder; std::getline(folders, folder, ':');)
        if (!folder.empty() && fs::exists(root / fs::path(folder).relative_path() / file, missing))
            return true;
    return false;
}

// "graphics,compute" with no `graphics`, which `all` has; unset means utility and compute in NVIDIA's images
bool lacks_graphics(const char* capabilities)
{
    std::stringstream words(capabilities ? capabilities : "");
    for (std::string word; std::getline(words, word, ',');)
        if (word == "graphics" || word == "all")
            return false;
    return true;
}

void find_nvidia_gaps(const std::string& file, const std::vector<std::string>& manifests, const fs::path& root,
                      const Environment& environment, std::vector<DriverGap>& gaps)
{
    const char* capabilities = environment("NVIDIA_DRIVER_CAPABILITIES");
    if (!has_manifest(manifests, "nvidia")) {
        gaps.push_back(
            {fmt::format("/{} is there, and no nvidia_icd.json; {}", file,
                         lacks_graphics(capabilities) ? "start the container with NVIDIA_DRIVER_CAPABILITIES=all"
                                                      : "install NVIDIA's driver with its Vulkan part"),
             ""});
        return;
    }
    if (capabilities && lacks_graphics(capabilities))
        gaps.push_back({fmt::format("NVIDIA_DRIVER_CAPABILITIES is '{}', without graphics: NVIDIA's Vulkan libraries "
                                    "are not let in; start the container with all",
                                    capabilities),
                        ""});
    for (const Library& library : kOfNvidia)
        if (!has_library(root, library.file, environment))
            gaps.push_back({fmt::format("NVIDIA's driver needs {}", library.file), library.package});
}

void find_render_gaps(const std::string& file, const std::vector<std::string>& manifests, const fs::path& root,
                      std::vector<DriverGap>& gaps)
{
    std::ifstream vendor_file(root / "sys/class/drm" / fs::path(file).filename() / "device/vendor");
    std::string vendor; // empty: sys is not there
    vendor_file >> vendor;
    for (const auto& [of, maker, manifest] : kOfMesa)
        if (vendor == of && !has_manifest(manifests, manifest))
            gaps.push_back(
                {fmt::format("/{} is there, {}, and no Vulkan driver for it", file, maker), "mesa-vulkan-drivers"});
    if (vendor.empty() && std::ranges::all_of(manifests, is_of_a_cpu))
        gaps.push_back({fmt::format("/{} is there, and no Vulkan driver of a GPU", file), "mesa-vulkan-drivers"});
}

} // namespace

std::vector<DriverGap> find_driver_gaps(const std::vector<std::string>& manifests, const fs::path& root,
                                        const Environment& environment)
{
    std::vector<DriverGap> gaps;
    if (const std::string file = first_numbered(root, "dev/nvidia"); !file.empty())
        find_nvidia_gaps(file, manifests, root, environment, gaps);
    if (const std::string file = first_numbered(root, "dev/dri/renderD"); !file.empty())
        find_render_gaps(file, manifests, root, gaps);
    return gaps;
}

} // namespace semrover
