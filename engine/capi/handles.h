// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/capi/sized_rasterizer.h"
#include "engine/job/frame_chain.h"
#include "engine/job/world.h"
#include "engine/semrover.h"
#include "runtime/base/memory_files.h"
#include "runtime/device/device.h"
#include "runtime/device/host_copies.h"

// what the handles of the C interface hold
struct sr_context {
    std::unique_ptr<semrover::Device> device;
    semrover::DeviceSummary summary;
    std::string error;
    std::unique_ptr<semrover::HostCopies> copies; // from the first call that needs them on
    uint64_t worlds = 0;                          // made so far
};

struct sr_grid {
    semrover::VoxelGrid grid; // always sorted
};

struct sr_world {
    sr_context* context = nullptr;
    uint64_t number = 0;                           // of the context's worlds, from 1 on
    std::unique_ptr<semrover::MemoryFolder> files; // of its model, where the host has them in memory
    semrover::GenerationSettings settings;
    std::unique_ptr<semrover::World> world;
    semrover::capi::SizedRasterizer pixels;                 // of chains that draw
    semrover::capi::SizedRasterizer images[2], recorded[2]; // of draws; the second with depth test
    std::unique_ptr<semrover::CommandRing> commands;        // of sr_world_submit, from the first on
};

struct sr_chain {
    sr_context* context = nullptr;
    std::unique_ptr<semrover::MemoryFolder> files; // of its model, where the host has them in memory
    semrover::ImageSize size;
    std::unique_ptr<semrover::FrameChain> chain;
};
