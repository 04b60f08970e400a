// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/capi/camera_renderer.h"
#include "engine/capi/rasterizers.h"
#include "engine/job/flow_drawing.h"
#include "engine/job/model.h"
#include "engine/job/scene_actors.h"
#include "engine/job/sweep_drawing.h"
#include "engine/scene/label_edits.h"
#include "engine/semrover_vulkan.h"
#include "engine/world/world.h"
#include "runtime/device/device.h"
#include "runtime/device/external_copies.h"

#include <atomic>
#include <list>
#include <mutex>

// what the handles of the C interface hold
struct sr_context {
    std::atomic<uint32_t> in_use = 0;          // what calls at work use of it (capi::Use)
    std::unique_ptr<semrover::Device> device;  // of the calls that generate and refine
    std::unique_ptr<semrover::Device> drawing; // of those that draw, maybe at the same time: the other queue, if any
    semrover::DeviceSummary summary;
    mutable std::mutex error_mutex;
    std::string error;
    std::unique_ptr<semrover::ExternalCopies> copies; // by the drawing device, from the first call that needs them on
    uint64_t worlds = 0;                              // made so far
};

// Voxels that are set are put into the grid when it is next read: one by one each would cost the whole grid.
struct sr_grid {
    mutable semrover::VoxelGrid grid; // sorted
    mutable semrover::LabelEdits edits;

    semrover::VoxelGrid& read() const
    {
        if (!edits.empty())
            grid = with_edits(grid, edits); // may throw: they stay until it has them
        edits.clear();
        return grid;
    }
};

struct sr_model {
    sr_context* context = nullptr;
    std::shared_ptr<semrover::Model> model;
};

namespace semrover::capi {

// a lidar of a world's, and what draws its sweeps
struct WorldLidar {
    std::shared_ptr<const Lidar> table;
    RasterizerOptions options = {};
    std::unique_ptr<SweepDrawing> drawing = {};
};

} // namespace semrover::capi

struct sr_world {
    sr_context* context = nullptr;
    uint64_t number = 0; // of the context's worlds, from 1 on
    std::shared_ptr<semrover::Model> model;
    // for the call that works; what other threads ask for meanwhile is posted, and done by the next one
    std::mutex work;
    std::unique_ptr<semrover::World> world;
    std::mutex post;
    semrover::WorldFoci foci; // none: they are as before
    semrover::LabelEdits edits;
    std::list<semrover::CellWindow> labels_ready;
    sr_world_info info = {}; // as the last call left it
    // of the thread that draws
    semrover::ObjectsById objects; // that it was given
    semrover::SceneActors actors;
    semrover::capi::Rasterizers pixels;              // of renderers that draw
    semrover::capi::Rasterizers images, recorded;    // of draws
    std::unique_ptr<semrover::CommandRing> commands; // of our own submits, from the first on
    bool updated_by_application = false;             // by sr_world_record_updates
    semrover::TimelinePoint done;                    // when all that was recorded so far has been executed
    std::vector<std::pair<semrover::TimelinePoint, std::shared_ptr<semrover::Rasterizer>>> retired;
    std::unique_ptr<semrover::FlowDrawing> flow;              // from the first call on
    std::map<std::string, semrover::capi::WorldLidar> lidars; // by name
};

struct sr_renderer {
    sr_context* context = nullptr;
    std::shared_ptr<semrover::Model> model;
    semrover::ImageSize size;
    std::unique_ptr<semrover::CameraRenderer> camera;
};

namespace semrover::capi {

// Errors: usage for NULL, and for a model of another context. name: of the structure
Result<std::shared_ptr<Model>> model_of(const sr_context& context, const sr_model* model, const char* name);

} // namespace semrover::capi
