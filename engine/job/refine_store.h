// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/deferred/deferred_renderer.h"
#include "engine/format/buffer_folder.h"
#include "engine/job/outgoing.h"
#include "engine/job/piece_record.h"

namespace semrover {

// a latent of an earlier run's file: [height, width, channels]. Errors: bad_input for another shape, for NaN
Result<std::vector<float>> read_latent(const Path& path, const LatentSize& size, uint32_t channels);

// a camera whose splat buffers are files, or will be
struct RefinedCamera : CameraChain {
    BufferCamera buffers;
    FrameRange range;
    std::vector<FrameWindow> windows;    // of the range, as they are denoised
    std::vector<float> latents_before;   // of the frames before the range that an earlier run made
    std::vector<uint8_t> picture_before; // finished, before the range; empty: none
    std::vector<CameraFrame> cameras;    // of all frames, where surfaces are followed from one to the next
};

enum class PieceKind {
    encoded, // encoded/CAMERA/000000.safetensors: latent of the buffer, until the run is finished
    latent,  // latents/CAMERA/000000.safetensors
    frame,   // frames/CAMERA/000000.png or .jpg
};

// The pieces of a run in its folder, and which of them are done: those that the journal names with the hash that the
// file has. A camera without a name has no folder of its own.
class RefineStore {
  public:
    RefineStore(RunFolder& run, const PictureEncoding& encoding, uint32_t channels); // reads the journal

    bool lossless() const { return !encoding_.jpeg; } // a frame that is loaded is the one that was saved
    std::string name(PieceKind kind, const BufferCamera& camera, uint32_t frame) const; // from the run's folder on
    bool has(PieceKind kind, const BufferCamera& camera, uint32_t frame) const;

    // on any thread; what they return is called on one at a time
    Result<FileQueue::Commit> make_latent(PieceKind kind, const BufferCamera& camera, uint32_t frame,
                                          const LatentSize& size, std::span<const float> latent);
    Result<FileQueue::Commit> make_frame(const BufferCamera& camera, uint32_t frame, std::span<const uint8_t> pixels);
    Result<std::vector<float>> load_latent(PieceKind kind, const BufferCamera& camera, uint32_t frame,
                                           const LatentSize& size) const;
    Result<ImageRgb8> load_frame(const BufferCamera& camera, uint32_t frame) const;

  private:
    Path path(PieceKind kind, const BufferCamera& camera, uint32_t frame) const;
    Result<FileQueue::Commit> make(std::string piece, std::span<const std::byte> bytes);

    Path folder_;
    PictureEncoding encoding_;
    uint32_t channels_;
    PieceRecord record_; // by path in the run's folder
};

// The renderer's ends in files, of chains that are RefinedCameras: buffers from their folders, or as they are being
// drawn; latents and frames into the run's folder, behind the renderer's back.
class RefineFiles : public FrameStore {
  public:
    // all of it outlives this
    RefineFiles(Device& device, RefineStore& store, Outgoing& out) : device_(device), store_(store), out_(out) {}

    void set_drawn(bool drawn) { drawn_ = drawn; } // buffers are being drawn, and given here before they are files

    // A buffer of a camera, in order from the first frame on. Its pixels (SplatPixelSlots::seen) stay until the next
    // one's; its depth may come later.
    void give_buffer(const std::string& camera, uint32_t frame, const DeviceTensor& seen);
    void give_depth(const std::string& camera, uint32_t frame, DepthPicture depth);
    bool waits_for(const FrameTask& task) const; // a buffer of it that was not given yet

    Status read_seen(const CameraChain& chain, uint32_t frame, const DeviceTensor& to) override;
    Result<FrameView> view(const CameraChain& chain, uint32_t frame) override;
    Status save_frame(const CameraChain& chain, uint32_t frame, const DeviceTensor& pixels) override;
    Status save_latent(const CameraChain& chain, uint32_t frame, const std::vector<float>& latent) override;
    bool keeps_encoded() const override { return true; }
    Status save_encoded(const CameraChain& chain, uint32_t frame, std::vector<float> latent) override;
    Result<EncodedBuffer> load_encoded(const CameraChain& chain, uint32_t frame) override;
    Result<std::vector<float>> load_latent(const CameraChain& chain, uint32_t frame) override;
    Result<std::vector<uint8_t>> load_frame(const CameraChain& chain, uint32_t frame) override;

  private:
    struct Given {
        DeviceTensor seen;                       // of the last buffer that was given
        uint32_t buffers = 0;                    // so far
        std::map<uint32_t, DepthPicture> latest; // depths, whether given or read
    };
    Status save(PieceKind kind, const CameraChain& chain, uint32_t frame, std::vector<float> latent);

    Device& device_;
    RefineStore& store_;
    Outgoing& out_;
    bool drawn_ = false;
    std::unique_ptr<CopyRing> copies_;
    std::map<std::string, Given> given_; // by camera
};

} // namespace semrover
