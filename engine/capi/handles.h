// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/capi/sized_rasterizer.h"
#include "engine/job/frame_chain.h"
#include "engine/job/world.h"
#include "engine/semrover.h"
#include "runtime/device/device.h"
#include "runtime/device/host_copies.h"

// what the handles of the C interface hold
struct sr_context {
    std::unique_ptr<semrover::Device> device;
    semrover::DeviceSummary summary;
    std::string error;
    std::unique_ptr<semrover::HostCopies> copies; // from the first call that needs them on
};

struct sr_grid {
    semrover::VoxelGrid grid; // always sorted
};

struct sr_world {
    sr_context* context = nullptr;
    semrover::GenerationSettings settings;
    std::unique_ptr<semrover::World> world;
    semrover::capi::SizedRasterizer pixels;                 // of chains that draw
    semrover::capi::SizedRasterizer images[2], recorded[2]; // of draws; the second with depth test
    std::unique_ptr<semrover::CommandRing> commands;        // of sr_world_submit, from the first on
};

struct sr_chain {
    sr_context* context = nullptr;
    semrover::ImageSize size;
    std::unique_ptr<semrover::FrameChain> chain;
};
