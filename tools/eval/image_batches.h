// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/eval/inception.h"

#include <map>

namespace semrover {

// Features of images of one or several sizes: those of one size wait until they fill a batch, rows come in the order of
// the images. At most six sizes are kept ready at a time.
class ImageBatches {
  public:
    // `images`: how many there will be
    ImageBatches(Device& device, const Inception& network, uint32_t batch, size_t images);

    Status add(ImageRgb8 image);          // the next one
    Result<Features> finish();            // once, after the last
    size_t done() const { return done_; } // that went through the network

    const std::map<std::pair<uint32_t, uint32_t>, size_t>& sizes() const { return sizes_; } // width, height: images

  private:
    struct Waiting {
        ImageSize size;
        std::unique_ptr<ImageFeatures> extractor;
        std::vector<ImageRgb8> images;
        std::vector<size_t> rows;
    };
    Status prepare(ImageSize size); // its Waiting is the last one
    Status flush(Waiting& waiting);

    Device* device_;
    const Inception* network_;
    uint32_t batch_;
    size_t images_, added_ = 0, done_ = 0;
    std::vector<Waiting> waiting_; // by last use
    std::map<std::pair<uint32_t, uint32_t>, size_t> sizes_;
    Features features_;
};

} // namespace semrover
