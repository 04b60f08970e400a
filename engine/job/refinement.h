// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/job.h"
#include "engine/job/path_drawing.h"
#include "engine/job/refine_store.h"

namespace semrover {

// what `refine` does: splat buffers to frames, each from the one before, or windows of them together
struct RefinementOptions {
    Path input, model, output;      // input: a folder of buffers, or a grid
    std::optional<Sampler> sampler; // as the model says
    RendererOptions renderer;
    DType precision = DType::f16;
    std::optional<uint32_t> first_frame, last_frame; // of every camera, both included; the camera's first, and last
    std::shared_ptr<LoadedNetworks> networks = {};   // of the model, in that precision, shared; none: loaded
    Path from;                                       // output of an earlier run, whose latents come before first_frame
    PictureEncoding encoding;                        // of the frames
    uint32_t threads = 0;                            // that make files; 0: usable_threads()
    std::optional<ImageSize> size;                   // of the pictures, refused where it is another
    std::optional<CameraPath> path;                  // of the pictures, or through the grid
    DrawOptions draw;                                // of a grid
    bool allow_empty = false;                        // it is no error if no buffer of a grid shows anything
    bool radius_given = false;                       // draw.splats says how wide splats are, not the model
    std::function<Result<VoxelGrid>()> grid;         // of `input`, called when it is drawn
    bool replace = false;                            // what is in `output`

    bool from_grid() const { return is_file(input); }
    // of the buffers that are drawn of a grid: their colours, which are the renderer's input, have no loss
    PictureEncoding buffer_encoding() const
    {
        return {.png_level = encoding.png_level, .depth = encoding.depth, .flow = encoding.flow};
    }
};

// what a run will do, as far as it can be known without a device
struct Refinement {
    RefinementOptions options; // with the path that lies beside the buffers, and how the model wants splats drawn
    RendererModel model;
    RendererSettings settings;
    std::vector<RefinedCamera> cameras;

    size_t frames() const;
    // true when `output` holds a run that was stopped, or is finished
    bool was_stopped() const;
    bool was_finished() const;
    // what would be replaced is refused (usage), and so are `beside`, which the caller will write; a run that is there
    // may go on, or be done
    Status check_outputs(std::span<const Path> beside) const;
};

// transforms.json of the frames that a run makes, in its output. Nothing where their cameras are not known
Status write_frame_cameras(const Refinement& r);
// likewise the DriveRecord: that of the buffers where one lies beside them
Status write_frame_record(const Refinement& r, const JobCallbacks& callbacks);

// Opens the model, settles how it draws and denoises, and looks at the buffers. Errors: bad_input, usage
Result<Refinement> resolve_refinement(RefinementOptions options, const JobCallbacks& callbacks);

// everything that decides the bytes of the frames
Result<Json> refinement_settings(const Refinement& r, const Device& device);

// the memory of a run of which nothing is done yet; out_of_memory when no policy fits
Result<MemoryPlan> plan_refinement(Device& device, const Refinement& r);

// the same as figures: frames, steps, policy, planned_device_bytes, what each policy takes, bytes of both networks
Json describe(const Device& device, const Refinement& r, const MemoryPlan& plan);

struct RefinementCallbacks : JobCallbacks {
    // when what is left to do is known, before frames are refined
    std::function<void(const Refinement&, const MemoryPlan&)> planned;
    // all frames are there; before the run counts as finished, and again where it was finished before
    std::function<Status(const RefineStore&, std::span<const RefinedCamera>)> refined;
};

// Stages: "render" counts frames that are drawn of a grid, "refine" denoising steps of frames, or of windows; with the
// staged policy "encode" and "decode" count frames. What is done is in the output's folder: begun again after a cancel
// or a kill, the job goes on to the same bytes; where all is done it has nothing to do. Figures: output, frames, steps,
// seconds, policy, planned_device_bytes, peak_device_bytes, and of a grid render_device_bytes. Errors: as check_outputs
// and plan_refinement; bad_input for another run in the folder
Result<std::unique_ptr<Job>> begin_refinement(Device& device, Refinement refinement,
                                              const RefinementCallbacks& callbacks);

} // namespace semrover
