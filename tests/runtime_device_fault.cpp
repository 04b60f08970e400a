// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/device_fault.h"

#include <cstring>
#include <gtest/gtest.h>

namespace semrover {
namespace runtime_device_fault_test {

TEST(runtime_device_fault, tells_all_that_a_driver_says)
{
    auto info = vk_struct<VkDeviceFaultInfoEXT>(VK_STRUCTURE_TYPE_DEVICE_FAULT_INFO_EXT);
    EXPECT_EQ(fault_text(info, {}, {}), "");
    std::strcpy(info.description, "page fault");
    const VkDeviceFaultAddressInfoEXT addresses[] = {
        {VK_DEVICE_FAULT_ADDRESS_TYPE_WRITE_INVALID_EXT, 0x12345000, 4096},
        {VK_DEVICE_FAULT_ADDRESS_TYPE_INSTRUCTION_POINTER_FAULT_EXT, 0xff00, 1},
    };
    VkDeviceFaultVendorInfoEXT vendor{};
    std::memset(vendor.description, 'x', sizeof vendor.description); // not ended
    vendor.vendorFaultCode = 7;
    const std::string text = fault_text(info, addresses, {&vendor, 1});
    EXPECT_EQ(text, "; page fault; invalid write at 0x12345000, known to 4096 bytes; instruction pointer 0xff00, known "
                    "to 1 bytes; " +
                        std::string(sizeof vendor.description, 'x') + " (code 0x7, data 0x0)");
}

TEST(runtime_device_fault, names_the_call_and_says_what_kind_of_error_it_is)
{
    const Error memory =
        vk_error(VK_ERROR_OUT_OF_HOST_MEMORY, "device_.vk().CreateBufferView(device_.handle(), &info)");
    EXPECT_EQ(memory.message, "VK_ERROR_OUT_OF_HOST_MEMORY (-1) from vkCreateBufferView");
    EXPECT_EQ(memory.code, ErrorCode::out_of_memory);
    EXPECT_EQ(vk_error(VK_ERROR_MEMORY_MAP_FAILED, "vk.MapMemory(d)").code, ErrorCode::out_of_memory);
    EXPECT_EQ(vk_error(VK_ERROR_FRAGMENTED_POOL, "vkCreateThing").message,
              "VK_ERROR_FRAGMENTED_POOL (-12) from vkCreateThing");
}

// other errors are as they are: nobody is asked
TEST(runtime_device_fault, asks_for_lost_devices_only)
{
    const Error error = device_error({}, VK_NULL_HANDLE, VK_ERROR_OUT_OF_DEVICE_MEMORY, "vkQueueSubmit");
    EXPECT_EQ(error.code, ErrorCode::out_of_memory);
    EXPECT_EQ(error.message, vk_error(VK_ERROR_OUT_OF_DEVICE_MEMORY, "vkQueueSubmit").message);
}

} // namespace runtime_device_fault_test
} // namespace semrover
