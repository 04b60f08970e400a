// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/device.h"

namespace semrover {

// Command buffers that are recorded and submitted once, one after the other, and used again when the device has
// finished them.
class CommandRing {
  public:
    static Result<std::unique_ptr<CommandRing>> create(Device& device, size_t count = 8);
    ~CommandRing();
    CommandRing(const CommandRing&) = delete;
    CommandRing& operator=(const CommandRing&) = delete;

    // the next one, begun; waits until it is free. One that was begun and not submitted is dropped
    Result<VkCommandBuffer> begin();
    // ends and submits what begin() gave last; the ticket is for Device::wait
    Result<uint64_t> submit(const TimelinePoints& points = {});

  private:
    explicit CommandRing(Device& device) : device_(device) {}

    Device& device_;
    VkCommandPool pool_ = VK_NULL_HANDLE;
    std::vector<VkCommandBuffer> commands_;
    std::vector<uint64_t> tickets_; // when each may be used again
    size_t next_ = 0;
    bool open_ = false; // begun, not submitted
};

} // namespace semrover
