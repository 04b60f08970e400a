// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/run_folder.h"
#include "engine/voxfield/outpaint.h"
#include "engine/voxfield/voxfield_model.h"
#include "runtime/device/device.h"
#include "tools/cli/commands.h"

#include <optional>

namespace semrover {

// what generate, edit and inpaint share: a model, how it samples, how a grid is cut into regions
struct GenerationOptions {
    std::string model, sampler, preset, known, strategy = "complete", precision = "fp16", profile;
    std::optional<int> steps, region_size, coverage_threshold, jump_length, jump_n_sample;
    std::optional<float> cfg_scale;
    uint32_t batch = 0; // 0: what suits the device
    int64_t first_cell = 0;
    bool dry_run = false;
};
void add_generation_options(CLI::App& command, GenerationOptions& options);

// options over the preset over the model's defaults
struct GenerationSettings {
    VoxfieldModel model;
    SamplingPlan plan;
    int steps = 0;
    float guidance = 0;
    RegionOptions regions;
    RepaintOptions repaint;
    DType precision = DType::f16;
};

// Fills grids with points on a device, region by region, with the state of each run in a folder. In order: resolve,
// open, then for each grid (or seed) begin, load, fill.
class Generation {
  public:
    Generation(const GenerationOptions& options, const Globals& globals) : options_(options), globals_(globals) {}

    Status resolve(); // reads the model's description, no weights
    Status open();    // the device
    // cuts the grid, which must outlive the filling, into regions; cells with generated = 0 are the targets
    Status begin(VoxelGrid& grid, const RegionOptions& regions);
    // weights if they are not there yet, a sampler if the seed is another, and the batch that fits --max-vram
    Status load(uint64_t seed);
    // takes up what `run` holds already and does the rest; every region is saved as it is finished
    Status fill(RunFolder& run, std::string_view output);
    // without a folder: `cells` hears how many cells of the grid are done, and false stops
    Status fill(const std::function<bool(size_t cells)>& progress);

    // --dry-run: measures a step, says what `runs` such fillings would take
    Status report_dry_run(size_t runs = 1);

    // everything that decides the bytes of the result, beside the seed
    Result<Json> settings_json(std::string_view command, uint64_t grid_hash) const;
    // cells, regions, seconds and memory of the last filling
    Json results_json() const;
    Status write_profile() const;

    const GenerationSettings& settings() const { return settings_; }
    Device& device() { return *device_; }
    const Outpainter& outpainter() const { return *outpainter_; }
    uint64_t planned_bytes() const { return planned_bytes_; }
    // for full batches of full regions: what any grid may take. Needs load.
    Result<uint64_t> bound_bytes() const;

  private:
    Status fit_batch();
    uint32_t wanted_batch() const;
    Result<uint64_t> bytes_of(uint32_t batch, uint32_t cells) const;

    const GenerationOptions& options_;
    const Globals& globals_;
    GenerationSettings settings_;
    std::unique_ptr<Device> device_;
    std::unique_ptr<Transformer> transformer_;
    std::unique_ptr<TokenSampler> sampler_;
    std::unique_ptr<Outpainter> outpainter_;
    std::optional<uint64_t> seed_;
    uint32_t batch_ = 1, widest_batch_ = 1;
    uint64_t base_bytes_ = 0; // of what is there before the sampler's tables and batches
    uint64_t planned_bytes_ = 0, peak_bytes_ = 0;
    double seconds_ = 0;
};

// what cannot be written is refused now, not after an hour
Status check_writable(const Path& path, const Globals& globals);

} // namespace semrover
