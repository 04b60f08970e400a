// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/deferred/loaded_networks.h"
#include "engine/network/transformer.h"
#include "engine/voxfield/voxfield_model.h"
#include "runtime/base/memory_files.h"

namespace semrover {

struct ModelRequest {
    Path path; // a folder; of a renderer alone a .safetensors file of the LDM layout, too
    std::unique_ptr<MemoryFolder> files = {}; // that `path` leads into, where the caller has it in memory
    std::string preset = {};                  // of the voxfield transformer; empty: none
    DType precision = DType::f16;
    bool voxfield = true, renderer = true; // what is loaded of it
    bool if_there = true;                  // what the folder has of these, one of them at least; else all of them
};

// A model's networks on a device, loaded once and shared by all worlds and renderers that are made with it. The device
// outlives it.
class Model {
  public:
    // Bytes that are on the device, of all that will be; false gives up
    using Progress = std::function<bool(uint64_t done, uint64_t total)>;

    // Calls progress, which may be empty, after each tensor. Errors: bad_input for files that are missing or do not
    // fit; out_of_memory; interrupted where progress gives up. Nothing stays on the device then
    static Result<std::shared_ptr<Model>> load(Device& device, ModelRequest request, const Progress& progress = {});

    const Path& path() const { return request_.path; }
    const std::string& preset() const { return request_.preset; }
    DType precision() const { return request_.precision; }
    uint64_t device_bytes() const { return bytes_; } // of all weights

    // null where the model has none, or it was not asked for
    const VoxfieldModel* voxfield() const { return voxfield_ ? &*voxfield_ : nullptr; }
    const std::shared_ptr<const Transformer>& transformer() const { return transformer_; }
    const std::shared_ptr<LoadedNetworks>& renderer() const { return renderer_; }

  private:
    explicit Model(ModelRequest request) : request_(std::move(request)) {}
    Status open(Device& device);
    Status upload(Device& device, const Progress& progress);

    ModelRequest request_;
    std::optional<VoxfieldModel> voxfield_;
    std::shared_ptr<const Transformer> transformer_;
    std::shared_ptr<LoadedNetworks> renderer_;
    uint64_t bytes_ = 0, renderer_bytes_ = 0; // of all weights, and of them
};

} // namespace semrover
