// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: posix
// what a container lacks of a GPU's driver, in made-up roots
#include "runtime/device/driver_gaps.h"

#include "tests/support/scratch_folder.h"

#include <gtest/gtest.h>
#include <map>

namespace semrover {
namespace driver_gaps_test {

namespace fs = std::filesystem;

struct Root {
    ScratchFolder folder;
    std::vector<std::string> manifests = {"/usr/share/vulkan/icd.d/lvp_icd.x86_64.json"};
    std::map<std::string, std::string> variables = {};

    void put(const std::string& name, const std::string& text = "")
    {
        fs::create_directories((folder / name).parent_path());
        folder.put(name, text);
    }
    // text and package of each gap
    std::vector<std::string> gaps() const
    {
        std::vector<std::string> lines;
        const auto environment = [this](const char* name) {
            const auto found = variables.find(name);
            return found == variables.end() ? nullptr : found->second.c_str();
        };
        for (const DriverGap& gap : find_driver_gaps(manifests, folder.path(), environment))
            lines.push_back(gap.text + " [" + gap.package + "]");
        return lines;
    }
};

using Lines = std::vector<std::string>;

TEST(driver_gaps, a_machine_without_device_files_lacks_nothing)
{
    Root root;
    root.put("dev/nvidiactl"); // of a driver without a GPU
    root.put("dev/dri/card0"); // shows pictures only
    root.variables["NVIDIA_DRIVER_CAPABILITIES"] = "compute,utility";
    EXPECT_EQ(root.gaps(), Lines());
}

TEST(driver_gaps, a_container_that_got_no_vulkan_of_nvidia)
{
    Root root;
    root.put("dev/nvidia1");
    root.put("dev/nvidia0");
    const Lines unset = root.gaps();
    root.variables["NVIDIA_DRIVER_CAPABILITIES"] = "compute,utility";
    EXPECT_EQ(root.gaps(), unset);
    EXPECT_EQ(unset, Lines{"/dev/nvidia0 is there, and no nvidia_icd.json; start the container with "
                           "NVIDIA_DRIVER_CAPABILITIES=all []"});
    root.variables["NVIDIA_DRIVER_CAPABILITIES"] = "all";
    EXPECT_EQ(root.gaps(), Lines{"/dev/nvidia0 is there, and no nvidia_icd.json; install NVIDIA's driver with its "
                                 "Vulkan part []"});
}

TEST(driver_gaps, libraries_that_nvidias_driver_opens)
{
    Root root;
    root.put("dev/nvidia0");
    root.manifests.push_back("/etc/vulkan/icd.d/nvidia_icd.json");
    root.put("usr/lib/x86_64-linux-gnu/libX11.so.6");
    root.put("opt/gl/libEGL.so.1");
    EXPECT_EQ(root.gaps(),
              (Lines{"NVIDIA's driver needs libXext.so.6 [libxext6]", "NVIDIA's driver needs libEGL.so.1 [libegl1]"}));
    root.variables["LD_LIBRARY_PATH"] = "/usr/local/cuda/lib64:/opt/gl";
    EXPECT_EQ(root.gaps(), Lines{"NVIDIA's driver needs libXext.so.6 [libxext6]"});
    root.put("usr/lib/x86_64-linux-gnu/libXext.so.6");
    EXPECT_EQ(root.gaps(), Lines());
    root.variables["NVIDIA_DRIVER_CAPABILITIES"] = "compute,graphics";
    EXPECT_EQ(root.gaps(), Lines());
    root.variables["NVIDIA_DRIVER_CAPABILITIES"] = "compute,display";
    EXPECT_EQ(root.gaps().size(), 1u);
    EXPECT_NE(root.gaps().front().find("'compute,display', without graphics"), std::string::npos);
}

TEST(driver_gaps, a_gpu_that_mesa_drives)
{
    Root root;
    root.put("dev/dri/renderD129");
    root.put("dev/dri/renderD128");
    const std::string vendor = "sys/class/drm/renderD128/device/vendor";
    EXPECT_EQ(root.gaps(), Lines{"/dev/dri/renderD128 is there, and no Vulkan driver of a GPU [mesa-vulkan-drivers]"});
    root.put(vendor, "0x1002\n");
    EXPECT_EQ(root.gaps(),
              Lines{"/dev/dri/renderD128 is there, AMD, and no Vulkan driver for it [mesa-vulkan-drivers]"});
    root.manifests.push_back("/usr/share/vulkan/icd.d/radeon_icd.x86_64.json");
    EXPECT_EQ(root.gaps(), Lines());
    root.put(vendor, "0x8086\n");
    EXPECT_EQ(root.gaps(),
              Lines{"/dev/dri/renderD128 is there, Intel, and no Vulkan driver for it [mesa-vulkan-drivers]"});
    root.put(vendor, "0x10de\n"); // NVIDIA's driver makes one beside /dev/nvidia0
    EXPECT_EQ(root.gaps(), Lines());
    root.put(vendor, "0x1af4\n"); // of a virtual machine
    EXPECT_EQ(root.gaps(), Lines());
}

} // namespace driver_gaps_test
} // namespace semrover
