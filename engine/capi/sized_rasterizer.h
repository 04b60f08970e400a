// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/image_size.h"
#include "engine/splat/rasterizer.h"
#include "engine/splat/splat_pool.h"

namespace semrover::capi {

// A rasterizer of a pool's splats, of one kind, for a number of cameras and the size of the last pictures: made anew
// when another size or format is asked for, there are more splats than it looks at, or it lacked room.
class SizedRasterizer {
  public:
    // errors: as Rasterizer has them
    Result<Rasterizer*> of(Device& device, const SplatPool& splats, const ImageSize& size, RasterizerOptions options,
                           uint32_t cameras = 1)
    {
        const bool sized = rasterizer_ && size_ == size && alpha_ == options.visible_alpha &&
                           formats_ == options.formats && cameras_ == cameras;
        if (sized && splats.end() <= rasterizer_->rows() && pairs_ <= rasterizer_->max_pairs())
            return rasterizer_.get();
        options.rows = splats.end();
        if (rasterizer_ && (pairs_ || rasterizer_->rebuilds())) // more than it begins with
            options.max_pairs = std::max({pairs_, rasterizer_->max_pairs(), 4 * splats.end()});
        rasterizer_.reset();
        SR_TRY(rasterizer_, Rasterizer::create(device, splats.scene(), size.width, size.height, cameras, options));
        pairs_ = std::min(pairs_, rasterizer_->max_pairs()); // what the device has room for
        size_ = size;
        alpha_ = options.visible_alpha;
        formats_ = options.formats;
        cameras_ = cameras;
        return rasterizer_.get();
    }

    // The same for drawings that are recorded: one that is made anew goes to `retired`, as what it recorded may still
    // be executed
    Result<Rasterizer*> of(Device& device, const SplatPool& splats, const ImageSize& size, RasterizerOptions options,
                           std::vector<std::shared_ptr<Rasterizer>>& retired)
    {
        const std::shared_ptr<Rasterizer> last = rasterizer_;
        const auto found = of(device, splats, size, options);
        if (last && last != rasterizer_)
            retired.push_back(last);
        return found;
    }

    // Had all of the last drawings room for their splats? If not, that is told once: the next rasterizer has more
    bool was_whole()
    {
        const uint32_t pairs = rasterizer_ ? rasterizer_->recorded_pairs() : 0;
        if (!rasterizer_ || pairs <= std::max(rasterizer_->max_pairs(), pairs_))
            return true;
        pairs_ = pairs + pairs / 4 + 1024;
        return false;
    }

  private:
    std::shared_ptr<Rasterizer> rasterizer_;
    ImageSize size_;
    uint32_t cameras_ = 0;
    float alpha_ = 0;
    std::array<PictureFormat, 4> formats_ = {};
    uint32_t pairs_ = 0; // that there must be room for
};

} // namespace semrover::capi
