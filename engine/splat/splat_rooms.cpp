// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/splat/splat_rooms.h"

#include "runtime/device/command.h"

#include <bit>
#include <cstring>

namespace semrover {

namespace {

constexpr uint32_t kLeastRows = 256;
constexpr uint32_t kRowBytes = 44; // of the arrays that are uploaded

// where no point is: high above the first one, each beyond the reach of all others
std::array<float, 4> nowhere(const ScenePoints& points, size_t row)
{
    constexpr float kApart = 8, kAbove = 5000; // metres
    const auto& first = points.positions[0];
    return {first[0] + kApart * float(row % 256), first[1] + kApart * float(row / 256), first[2] + kAbove, 0};
}

// the arrays of kRowBytes, for as many rows as a room has
void write_rows(const ScenePoints& points, size_t shown, float opacity, uint32_t rows, std::byte* to)
{
    const size_t n = points.size();
    std::byte* const colors = to + size_t(rows) * 16;
    for (size_t i = 0; i < rows; ++i) {
        std::array<float, 4> position = i < n ? std::array<float, 4>{} : nowhere(points, i), color{};
        if (i < n) {
            std::ranges::copy(points.positions[i], position.begin());
            std::ranges::copy(points.colors[i], color.begin());
            position[3] = i < shown ? opacity : 0;
        }
        std::memcpy(to + i * 16, position.data(), 16);
        std::memcpy(colors + i * 16, color.data(), 16);
    }
    std::byte* words = colors + size_t(rows) * 16;
    for (const std::vector<uint32_t>* values : {&points.labels, &points.cells, &points.owners}) {
        const size_t known = values->size(); // of owners there may be none
        std::memcpy(words, values->data(), known * 4);
        std::memset(words + known * 4, 0, (rows - known) * 4);
        words += size_t(rows) * 4;
    }
}

} // namespace

Result<SplatRooms::Room*> SplatRooms::room_for(size_t points, const PointSplatOptions& options)
{
    const uint32_t rows = std::max(uint32_t(std::bit_ceil(points)), kLeastRows);
    for (const auto& room : rooms_)
        if (room->scene.size() == rows && room->options == options)
            return room.get();
    SR_TRY(SplatScene scene, SplatScene::reserve(device_, rows, false));
    auto room = std::make_unique<Room>(Room{options, std::move(scene), nullptr, nullptr});
    SR_TRY(room->upload, Buffer::create(device_, uint64_t(rows) * kRowBytes, MemoryKind::staging, "points of a tile"));
    Graph g(device_.limits());
    room->scene.derive(g, options);
    SR_TRY(room->executable, Executable::create(device_, g));
    return rooms_.emplace_back(std::move(room)).get();
}

Status SplatRooms::prepare(size_t points, const PointSplatOptions& options)
{
    SR_CHECK(check_point_splat_options(options));
    return room_for(points, options).map([](Room*) {});
}

Result<const SplatScene*> SplatRooms::record(VkCommandBuffer commands, const ScenePoints& points, size_t shown,
                                             const PointSplatOptions& options)
{
    SR_CHECK(check_points(points));
    SR_CHECK(check_point_splat_options(options));
    SR_ASSERT(points.size(), "splats of no points");
    SR_TRY(Room * room, room_for(points.size(), options));
    // a submit that failed reaches nothing
    SR_CHECK(device_.wait(std::min(room->busy_until, device_.last_ticket())));
    write_rows(points, shown, options.opacity, room->scene.size(), room->upload->mapped());
    const auto [positions, normals, colors, labels, cells, owners] = room->scene.arrays();
    record_entry_barrier(device_.vk(), commands); // the splats of the tile before have been copied
    uint64_t at = 0;
    for (const DeviceTensor& slot : {positions, colors, labels, cells, owners}) {
        const BufferSlice to = slot.slice();
        record_copy(device_.vk(), commands, room->upload->handle(), at, to.buffer->handle(), to.offset, to.bytes);
        at += to.bytes;
    }
    room->executable->record_into(commands);
    room->busy_until = device_.last_ticket() + 1;
    return &room->scene;
}

} // namespace semrover
