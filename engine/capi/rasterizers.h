// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/image_size.h"
#include "engine/splat/rasterizer.h"
#include "engine/splat/splat_pool.h"

#include <list>

namespace semrover::capi {

// Rasterizers of a pool's splats: the last few sizes and kinds of pictures that were asked for, so that two of them in
// turn are not made anew each time. One is made anew when there are more splats than it looks at, or it lacked room.
// What is given up goes to `retired`, where drawings that it recorded may still be executed.
class Rasterizers {
  public:
    using Retired = std::vector<std::shared_ptr<Rasterizer>>;
    static constexpr size_t kMost = 8;

    // errors: as Rasterizer has them
    Result<Rasterizer*> of(Device& device, const SplatPool& splats, const ImageSize& size,
                           const RasterizerOptions& options, uint32_t cameras = 1, Retired* retired = nullptr)
    {
        Kept& kept = kept_for(size, options, cameras, retired);
        if (kept.rasterizer && kept.rasterizer->is_built() && splats.end() <= kept.rasterizer->rows() &&
            kept.pairs <= kept.rasterizer->max_pairs())
            return kept.rasterizer.get();
        RasterizerOptions now = options;
        now.rows = splats.end();
        if (kept.rasterizer && (kept.pairs || kept.rasterizer->rebuilds())) // more than it begins with
            now.max_pairs = std::max({kept.pairs, kept.rasterizer->max_pairs(), 4 * splats.end()});
        give_up(kept, retired);
        const auto make = [&] {
            return Rasterizer::create(device, splats.scene(), size.width, size.height, cameras, now);
        };
        auto made = make();
        if (!made && made.error().code == ErrorCode::out_of_memory && kept_.size() > 1) { // the others make room
            while (kept_.size() > 1)
                drop_last(retired);
            made = make();
        }
        SR_TRY(kept.rasterizer, std::move(made));
        kept.pairs = std::min(kept.pairs, kept.rasterizer->max_pairs()); // what the device has room for
        return kept.rasterizer.get();
    }

    // Had all of the last drawings room for their splats? If not, that is said once: the next rasterizer has more
    bool were_whole()
    {
        bool whole = true;
        for (Kept& kept : kept_) {
            const uint32_t pairs = kept.rasterizer ? kept.rasterizer->recorded_pairs() : 0;
            if (!kept.rasterizer || pairs <= std::max(kept.rasterizer->max_pairs(), kept.pairs))
                continue;
            kept.pairs = pairs + pairs / 4 + 1024;
            whole = false;
        }
        return whole;
    }

  private:
    struct Kept {
        ImageSize size;
        RasterizerOptions options;
        uint32_t cameras;
        std::shared_ptr<Rasterizer> rasterizer = {};
        uint32_t pairs = 0; // that there must be room for
    };

    // comes to the front
    Kept& kept_for(const ImageSize& size, const RasterizerOptions& options, uint32_t cameras, Retired* retired)
    {
        const auto found = std::ranges::find_if(
            kept_, [&](const Kept& k) { return k.size == size && k.options == options && k.cameras == cameras; });
        if (found != kept_.end()) {
            kept_.splice(kept_.begin(), kept_, found);
            return kept_.front();
        }
        if (kept_.size() == kMost)
            drop_last(retired);
        kept_.push_front({size, options, cameras});
        return kept_.front();
    }
    static void give_up(Kept& kept, Retired* retired)
    {
        if (retired && kept.rasterizer)
            retired->push_back(std::move(kept.rasterizer));
        kept.rasterizer.reset();
    }
    void drop_last(Retired* retired)
    {
        give_up(kept_.back(), retired);
        kept_.pop_back();
    }

    std::list<Kept> kept_; // the last one that was asked for first
};

} // namespace semrover::capi
