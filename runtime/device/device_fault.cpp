// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/device_fault.h"

#include "runtime/device/physical_device.h"

#include <cstring>
#include <vector>

namespace semrover {

namespace {

const char* kind_of(VkDeviceFaultAddressTypeEXT type)
{
    switch (type) {
    case VK_DEVICE_FAULT_ADDRESS_TYPE_READ_INVALID_EXT:
        return "invalid read at";
    case VK_DEVICE_FAULT_ADDRESS_TYPE_WRITE_INVALID_EXT:
        return "invalid write at";
    case VK_DEVICE_FAULT_ADDRESS_TYPE_EXECUTE_INVALID_EXT:
        return "invalid instruction at";
    case VK_DEVICE_FAULT_ADDRESS_TYPE_INSTRUCTION_POINTER_UNKNOWN_EXT:
    case VK_DEVICE_FAULT_ADDRESS_TYPE_INSTRUCTION_POINTER_INVALID_EXT:
    case VK_DEVICE_FAULT_ADDRESS_TYPE_INSTRUCTION_POINTER_FAULT_EXT:
        return "instruction pointer";
    default:
        return "address";
    }
}

// drivers fill arrays of a fixed size, and need not end them
template <size_t n>
std::string_view text_of(const char (&array)[n])
{
    return {array, strnlen(array, n)};
}

std::string describe_fault(const VulkanCalls& vk, VkDevice device)
{
    const auto get =
        reinterpret_cast<PFN_vkGetDeviceFaultInfoEXT>(vk.GetDeviceProcAddr(device, "vkGetDeviceFaultInfoEXT"));
    auto counts = vk_struct<VkDeviceFaultCountsEXT>(VK_STRUCTURE_TYPE_DEVICE_FAULT_COUNTS_EXT);
    if (!get || get(device, &counts, nullptr) != VK_SUCCESS)
        return "";
    std::vector<VkDeviceFaultAddressInfoEXT> addresses(counts.addressInfoCount);
    std::vector<VkDeviceFaultVendorInfoEXT> vendor(counts.vendorInfoCount);
    counts.vendorBinarySize = 0; // a dump for the maker's tools: not asked for
    auto info = vk_struct<VkDeviceFaultInfoEXT>(VK_STRUCTURE_TYPE_DEVICE_FAULT_INFO_EXT);
    info.pAddressInfos = addresses.data();
    info.pVendorInfos = vendor.data();
    if (const VkResult result = get(device, &counts, &info); result != VK_SUCCESS && result != VK_INCOMPLETE)
        return "";
    return fault_text(info, std::span(addresses).first(std::min<size_t>(counts.addressInfoCount, addresses.size())),
                      std::span(vendor).first(std::min<size_t>(counts.vendorInfoCount, vendor.size())));
}

} // namespace

bool tells_faults(const VulkanCalls& vk, VkPhysicalDevice physical)
{
    if (!has_extension(vk, physical, VK_EXT_DEVICE_FAULT_EXTENSION_NAME))
        return false;
    auto faults = vk_struct<VkPhysicalDeviceFaultFeaturesEXT>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FAULT_FEATURES_EXT);
    auto features = vk_struct<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &faults);
    vk.GetPhysicalDeviceFeatures2(physical, &features);
    return faults.deviceFault;
}

Error device_error(const VulkanCalls& vk, VkDevice device, VkResult result, const char* call)
{
    Error error = vk_error(result, call);
    if (result == VK_ERROR_DEVICE_LOST)
        error.message += describe_fault(vk, device);
    return error;
}

std::string fault_text(const VkDeviceFaultInfoEXT& info, std::span<const VkDeviceFaultAddressInfoEXT> addresses,
                       std::span<const VkDeviceFaultVendorInfoEXT> vendor)
{
    std::string text;
    if (const std::string_view description = text_of(info.description); !description.empty())
        text += fmt::format("; {}", description);
    for (const VkDeviceFaultAddressInfoEXT& a : addresses)
        text +=
            fmt::format("; {} {:#x}, known to {} bytes", kind_of(a.addressType), a.reportedAddress, a.addressPrecision);
    for (const VkDeviceFaultVendorInfoEXT& v : vendor)
        text +=
            fmt::format("; {} (code {:#x}, data {:#x})", text_of(v.description), v.vendorFaultCode, v.vendorFaultData);
    return text;
}

} // namespace semrover
