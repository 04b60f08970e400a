// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// folders of pictures, in archives too, as fuse, refine and export take them
#include "engine/format/buffer_folder.h"
#include "engine/shards/shard_set.h"
#include "tests/fuzz/fuzz_target.h"
#include "tools/dataset/check_shards.h"
#include "tools/export/drive_input.h"
#include "tools/fuse/fusion_folder.h"

namespace semrover::fuzz {

namespace folders {

void shards(Bytes input)
{
    const InputFolder folder(input, kShardIndexName);
    const auto set = open_if_shards(folder);
    if (accepts(set) && *set)
        (void)accepts(check_shards(**set, [](uint64_t, uint64_t) { return Status(); }));
}

void shard_index(Bytes input)
{
    const InputFile file(input, kShardIndexName);
    (void)accepts(read_shard_index(Path(file).parent_path()));
}

void fuse_folder(Bytes input)
{
    const InputFolder folder(input, "transforms.json");
    auto read = FusionFolder::open(folder, {});
    if (!accepts(read) || !accepts(read->check_labels()))
        return;
    const DepthFrames frames = read->frames();
    for (size_t i = 0; i < std::min<size_t>(read->cameras().size(), 8); ++i)
        (void)accepts(frames.load(i));
}

void buffers(Bytes input)
{
    const InputFolder folder(input, "color/000000.png");
    const auto cameras = open_buffers(folder);
    if (!accepts(cameras))
        return;
    for (const BufferCamera& camera : *cameras) {
        (void)accepts(read_buffer(camera, 0));
        (void)accepts(read_depth(camera, 0));
        (void)accepts(read_label_picture(camera, 0));
    }
}

void drive(Bytes input)
{
    const InputFolder folder(input, "calibration.json");
    const auto read = open_drive(folder);
    if (!accepts(read))
        return;
    (void)read->tracks();
    for (size_t i = 0; i < std::min<size_t>(read->path.frames.size(), 4); ++i)
        (void)accepts(read->read_color(i));
}

constexpr FuzzTarget kTargets[] = {
    {"shards", "*.folder", shards, 32 << 10},
    {"shard_index", "*.json", shard_index},
    {"fuse_folder", "*.folder", fuse_folder, 64 << 10, 6 * 1032, 128 * kMebibyte},
    {"buffers", "*.folder", buffers, 64 << 10, 6 * 1032, 128 * kMebibyte},
    {"drive", "*.folder", drive, 64 << 10, 6 * 1032, 128 * kMebibyte},
};

} // namespace folders

std::span<const FuzzTarget> folder_targets()
{
    return folders::kTargets;
}

} // namespace semrover::fuzz
