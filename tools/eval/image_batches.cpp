// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/image_batches.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr size_t kMostReady = 6; // sizes: each has a program and arrays on the device

} // namespace

ImageBatches::ImageBatches(Device& device, const Inception& network, uint32_t batch, size_t images)
    : device_(&device), network_(&network), batch_(batch), images_(images)
{
}

Status ImageBatches::add(ImageRgb8 image)
{
    SR_ASSERT(added_ < images_, "more than {} images", images_);
    const ImageSize size{image.width, image.height};
    SR_CHECK(prepare(size));
    ++sizes_[{size.width, size.height}];
    Waiting& w = waiting_.back();
    w.images.push_back(std::move(image));
    w.rows.push_back(added_++);
    return w.images.size() == w.extractor->batch() ? flush(w) : Status{};
}

Status ImageBatches::prepare(ImageSize size)
{
    const auto found = std::ranges::find(waiting_, size, &Waiting::size);
    if (found != waiting_.end()) {
        std::rotate(found, found + 1, waiting_.end());
        return {};
    }
    if (waiting_.size() == kMostReady) {
        SR_CHECK(flush(waiting_.front()));
        waiting_.erase(waiting_.begin());
    }
    Waiting w{size, nullptr, {}, {}};
    SR_TRY(w.extractor, ImageFeatures::create(*device_, *network_, size, batch_));
    waiting_.push_back(std::move(w));
    return {};
}

Status ImageBatches::flush(Waiting& w)
{
    if (w.images.empty())
        return {};
    Features rows;
    SR_CHECK(w.extractor->append(w.images, rows));
    features_.cols = rows.cols;
    features_.values.resize(images_ * rows.cols);
    for (size_t i = 0; i < w.rows.size(); ++i)
        std::copy_n(rows.row(i), rows.cols, &features_.values[w.rows[i] * rows.cols]);
    done_ += w.rows.size();
    w.images.clear();
    w.rows.clear();
    return {};
}

Result<Features> ImageBatches::finish()
{
    SR_ASSERT(added_ == images_, "{} images of {}", added_, images_);
    for (Waiting& w : waiting_)
        SR_CHECK(flush(w));
    features_.rows = uint32_t(images_);
    return std::move(features_);
}

} // namespace semrover
