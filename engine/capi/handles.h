// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/world.h"
#include "engine/semrover.h"
#include "engine/splat/rasterizer.h"
#include "runtime/device/device.h"
#include "runtime/device/host_copies.h"

// what the handles of the C interface hold
struct sr_context {
    std::unique_ptr<semrover::Device> device;
    semrover::DeviceSummary summary;
    std::string error;
};

struct sr_grid {
    semrover::VoxelGrid grid; // always sorted
};

struct sr_world {
    sr_context* context = nullptr;
    semrover::GenerationSettings settings;
    std::unique_ptr<semrover::World> world;
    std::unique_ptr<semrover::Rasterizer> rasterizer; // of the last draw's size
    uint32_t width = 0, height = 0;
    std::unique_ptr<semrover::HostCopies> copies; // from the first draw that needs them on
};
