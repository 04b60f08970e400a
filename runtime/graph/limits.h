// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <cstdint>
#include <string>

namespace semrover {

enum class DeviceType { cpu, integrated, discrete, other };

// of cooperative matrices with fp16 factors and fp32 sums, [m, k] x [k, n]; m is 0 where a device has none
struct MatrixShape {
    uint32_t m = 0, n = 0, k = 0;
    uint32_t subgroup = 0;  // invocations that share one
    bool half_sums = false; // the same shape has fp16 sums as well
};

// What the graph compiler knows of a device: plain data, so that it is tested without one.
struct DeviceLimits {
    DeviceType type = DeviceType::cpu;
    uint32_t subgroup_size = 8;
    uint32_t features = 0; // KernelFeatures
    MatrixShape matrix;
    uint32_t max_shared_bytes = 16384;
    uint32_t max_group_threads = 128;
    uint32_t max_groups = 65535; // per dimension
    uint32_t compute_units =
        128; // that run workgroups side by side (multiprocessors); about, where a driver says nothing
    uint64_t max_storage_range = 128ull << 20;
    uint64_t max_texel_elements = 65536;
    uint64_t max_allocation = 1ull << 30;
    uint32_t offset_alignment = 256; // of storage ranges and texel views
    uint32_t max_push_bytes = 128;
    uint32_t max_storage_buffers = 16; // of a shader; Vulkan promises 4, kernels have up to 13
    double submit_seconds = 0.1;       // work of one submit; zero: no limit (CPU devices have no watchdog)
    bool side_by_side = false;         // memory is shared so that independent passes need no barrier between them
    std::string force_variant;         // "", or a kernel variant to prefer wherever it exists
    bool force_staging = false;        // upload through staging even where memory is host-visible
};

// Which variants of kernels a device gets, as far as they give other bits: for keys of results
std::string kernels_text(const DeviceLimits& limits);

// Lowers limits for tests:
// "shared=16384,range=67108864,alloc=536870912,fp16=0,coopmat=0,variant=simt,staging=1,branches=1,submit=0.001".
// Raising one above what the device has is refused.
Status override_limits(DeviceLimits& limits, const std::string& text);

} // namespace semrover
