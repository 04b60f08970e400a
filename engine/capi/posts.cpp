// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/capi/posts.h"

namespace semrover::capi {

namespace {

// taken from a world; what is left goes back, without allocating
class Posts {
  public:
    explicit Posts(sr_world& world) : world_(world)
    {
        const std::lock_guard lock(world.post);
        std::swap(foci_, world.foci);
        std::swap(edits_, world.edits);
        std::swap(ready_, world.labels_ready);
    }
    ~Posts()
    {
        const std::lock_guard lock(world_.post);
        world_.labels_ready.splice(world_.labels_ready.begin(), ready_);
        world_.edits.merge(edits_); // what is there already is newer
        if (world_.foci.empty())
            world_.foci.swap(foci_);
    }
    Posts(const Posts&) = delete;
    Posts& operator=(const Posts&) = delete;

    Status take()
    {
        for (; !ready_.empty(); ready_.pop_front())
            world_.world->labels_ready(ready_.front());
        if (!edits_.empty())
            SR_CHECK(world_.world->edit(edits_));
        edits_.clear();
        if (!foci_.empty())
            SR_CHECK(world_.world->focus(foci_));
        foci_.clear();
        return {};
    }

  private:
    sr_world& world_;
    WorldFoci foci_;
    LabelEdits edits_;
    std::list<CellWindow> ready_;
};

} // namespace

Status take_posts(sr_world& world)
{
    return Posts(world).take();
}

} // namespace semrover::capi
