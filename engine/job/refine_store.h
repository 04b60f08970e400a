// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/buffer_folder.h"
#include "engine/job/piece_record.h"
#include "engine/refine/latent_codec.h"

namespace semrover {

// a latent as a file: "latent" F32 [height, width, channels]. Errors of reading: bad_input for another shape, for NaN
Status write_latent(const Path& path, const LatentSize& size, std::span<const float> latent);
Result<std::vector<float>> read_latent(const Path& path, const LatentSize& size, uint32_t channels);

enum class PieceKind {
    encoded, // encoded/CAMERA/000000.safetensors: latent of the buffer, until the run is finished
    latent,  // latents/CAMERA/000000.safetensors
    frame,   // frames/CAMERA/000000.png or .jpg
};

struct FrameFormat {
    bool jpeg = false;
    int quality = 92;

    std::string_view extension() const { return jpeg ? "jpg" : "png"; }
};

// The pieces of a run in its folder, and which of them are done: those that the journal names with the hash that the
// file has. A camera without a name has no folder of its own.
class RefineStore {
  public:
    RefineStore(RunFolder& run, FrameFormat format, uint32_t channels); // reads the journal

    bool lossless() const { return !format_.jpeg; } // a frame that is loaded is the one that was saved
    std::string name(PieceKind kind, const BufferCamera& camera, uint32_t frame) const; // from the run's folder on
    Path path(PieceKind kind, const BufferCamera& camera, uint32_t frame) const;
    bool has(PieceKind kind, const BufferCamera& camera, uint32_t frame) const;

    Status save_latent(PieceKind kind, const BufferCamera& camera, uint32_t frame, const LatentSize& size,
                       std::span<const float> latent);
    Result<std::vector<float>> load_latent(PieceKind kind, const BufferCamera& camera, uint32_t frame,
                                           const LatentSize& size) const;
    Status save_frame(const BufferCamera& camera, uint32_t frame, std::span<const uint8_t> pixels);
    Result<ImageRgb8> load_frame(const BufferCamera& camera, uint32_t frame) const;

  private:
    Path folder_;
    FrameFormat format_;
    uint32_t channels_;
    PieceRecord record_; // by path in the run's folder
};

} // namespace semrover
