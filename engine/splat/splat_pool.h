// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/tiles.h"
#include "engine/splat/splat_rooms.h"
#include "runtime/device/command_ring.h"

#include <mutex>

namespace semrover {

// The splats of a world's tiles in one scene of fixed size: tiles come and go, and the others stay where they are.
//
// To make splats and to show them are two acts, of two threads: one adds and removes tiles, in rows that no draw looks
// at; the other records what shows those that were published, and hides those that left. Rows are used again when
// nothing on the device can look at them any more.
class SplatPool {
  public:
    static constexpr uint32_t kSplatBytes = 60; // in six arrays

    // bytes: of device memory, for bytes / kSplatBytes splats, rounded up to a block. Errors: usage where not one
    // fits, or an array is larger than the device can bind; out_of_memory
    static Result<std::unique_ptr<SplatPool>> create(Device& device, uint64_t bytes);

    const SplatScene& scene() const { return scene_; }

    // ---- by the thread that makes tiles

    // makes what add() of as many points needs, so that it does not. Errors: as add()'s
    Status prepare(size_t points, const PointSplatOptions& options) { return rooms_.prepare(points, options); }

    enum class Room : uint8_t {
        found,
        later, // when rows that left are not looked at any more
        none
    };
    // Makes splats of a tile's points where there is room, and does not wait for it. The tile's own of before are
    // there until the new ones are shown, but where there is not room for both. Points from number `own` on are those
    // of other tiles, and only neighbours of the first. Errors: as SplatScene::create() has them
    Result<Room> add(const TileIndex& tile, const ScenePoints& points, size_t own, const PointSplatOptions& options);
    void remove(const TileIndex& tile); // one that is not there is fine
    bool has(const TileIndex& tile) const { return places_.contains(tile); }
    size_t splats() const { return splats_; }
    // What was added and removed since the last call is shown together; waits until it is made
    Status publish();

    struct Place {
        uint32_t first = 0, count = 0; // rows
    };
    const std::map<TileIndex, Place>& places() const { return places_; }

    // ---- by the thread that draws, at the same time

    // Records what shows and hides what was published since updates_are_submitted(), with all that follows in the queue
    // after it. false: there was nothing
    bool record_updates(VkCommandBuffer commands);
    // What was recorded last will be executed; `done` is reached then, and its semaphore outlives the pool. Without
    // this the next record_updates() records it again.
    void updates_are_submitted(const TimelinePoint& done);
    // as of the last updates_are_submitted():
    uint32_t end() const { return shown_.empty() ? 0 : shown_.rbegin()->second; } // no row from here on is shown
    uint64_t version() const { return version_; }                                 // moves with every change

  private:
    struct Rows { // whole blocks
        uint32_t first = 0, count = 0;
        bool operator==(const Rows&) const = default;
    };
    struct Changes {
        std::vector<Rows> shown, hidden;
        void make_room(const Changes& more); // so that adding these allocates nothing
        void take(Changes& from);            // and empties it; where memory is short, nothing of it
    };
    struct Leaving {
        Rows rows;
        TimelinePoint done; // when no draw looks at them
    };

    SplatPool(Device& device, SplatScene scene) : device_(device), scene_(std::move(scene)), rooms_(device) {}
    std::optional<uint32_t> gap(uint32_t rows, const std::map<uint32_t, uint32_t>& used) const;
    Room room_later(uint32_t rows, const TileIndex& tile);
    Status take_back();
    void leave(const Place& place);
    Status fill(uint32_t first, const ScenePoints& points, uint32_t own, const PointSplatOptions& options);

    Device& device_;
    SplatScene scene_;
    // of the thread that makes tiles
    SplatRooms rooms_;
    std::unique_ptr<CommandRing> commands_;
    std::map<TileIndex, Place> places_;
    std::map<uint32_t, uint32_t> used_; // rows: first, end; of places, and of what leaves
    Changes staged_;
    uint64_t made_ = 0; // ticket of the last fill
    size_t splats_ = 0;
    // of both
    std::mutex mutex_;
    Changes published_;
    std::vector<Leaving> leaving_;
    // of the thread that draws
    Changes showing_;                                 // not known to be submitted yet
    std::map<uint32_t, uint32_t> shown_, next_shown_; // rows: first, end; those of showing_
    uint64_t version_ = 0;
};

} // namespace semrover
