// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/checkpoint.h"
#include "engine/model/load_progress.h"
#include "engine/model/unet_config.h"
#include "engine/network/transformer_2d.h"
#include "kernels/network.h"
#include "runtime/device/device.h"

#include <memory>

namespace semrover {

// UNet2DConditionModel, shaped like Stable Diffusion 1.5's, or UNetSpatioTemporalConditionModel, as of Stable Video
// Diffusion (docs/models.md §4). Its functions add to a graph.
class Unet {
  public:
    ~Unet();
    static Result<std::unique_ptr<Unet>> load(Device& device, const UnetConfig& config, const Checkpoint& weights,
                                              DType precision, const LoadProgress& progress = {});
    // lays out the weights without loading them, to plan memory
    static std::unique_ptr<Unet> plan(const UnetConfig& config, DType precision);

    const UnetConfig& config() const;
    DType precision() const;
    uint64_t parameters() const;
    uint64_t device_bytes(const DeviceLimits& limits) const; // of the weights

    // embeddings of the timesteps, a row each; run once per schedule
    uint32_t time_width() const;
    [[nodiscard]] Tensor time_table(Graph& g,
                                    Tensor timesteps,         // [T, 1] fp32 array
                                    Tensor class_labels = {}, // [T] u32, with num_class_embeds
                                    Tensor added = {}) const; // of a video: [T, added_numbers] fp32 array
                                                              // -> [T, time_width] fp32

    // of a video: embeddings of the frames' numbers, a row each; run once per number of frames
    // note: to be kept in a slot; nothing writes the columns between two transformers
    uint32_t frame_width() const;                                     // 0: not of videos
    [[nodiscard]] Tensor frame_table(Graph& g, Tensor numbers) const; // [frames, 1] fp32 array: 0, 1, ..
                                                                      // -> [frames, frame_width] fp32

    // keys and values of every cross-attention; run once per text
    uint32_t context_width() const;                                     // 0: none
    [[nodiscard]] Tensor context_table(Graph& g, Tensor context) const; // [rows, cross_attention_dim] in the network's
                                                                        // precision -> [rows, context_width] likewise
    using Context = TextContext;                                        // the table, from context_table()

    // one evaluation
    [[nodiscard]] FeatureMap forward(Graph& g,
                                     FeatureMap x,                  // in_channels, in the network's precision
                                     Tensor table,                  // [T, time_width]
                                     Tensor table_row,              // [batch] u32: row of the table for each image
                                     const Context& context) const; // out_channels, fp32
    // of videos: the images are the frames of one video after the other
    struct Videos {
        FrameEmbedding frames; // from frame_table()
        Tensor table_row;      // [videos] u32: row of the time table for each
    };
    [[nodiscard]] FeatureMap forward(Graph& g, FeatureMap x, Tensor table, Tensor table_row,
                                     const Context& context, // of each video
                                     const Videos& videos) const;

  private:
    struct Impl;
    explicit Unet(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

} // namespace semrover
