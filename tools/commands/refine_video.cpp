// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/commands/refine_video.h"

#include "tools/commands/video.h"

#include <optional>

namespace semrover {

namespace {

// pictures of one height beside each other, rows of [width, 3]
std::vector<uint8_t> joined(std::span<const std::span<const uint8_t>> pictures, const ImageSize& size)
{
    std::vector<uint8_t> out;
    const size_t row = size_t(size.width) * 3;
    for (uint32_t y = 0; y < size.height; ++y)
        for (const auto& picture : pictures)
            out.insert(out.end(), &picture[y * row], &picture[y * row] + row);
    return out;
}

// FILE.mp4, or FILE-CAMERA.mp4 when there are several cameras
Path video_path(const Path& file, const std::string& camera, size_t cameras)
{
    if (cameras == 1)
        return file;
    Path path = file;
    return path.replace_filename(fmt::format("{}-{}{}", file.stem().string(), camera, file.extension().string()));
}

Result<Video> open_video(const Path& file, const RefinedCamera& camera, size_t cameras, uint32_t pictures, int rate)
{
    const ImageSize& size = camera.buffers.size;
    return Video::create(video_path(file, camera.buffers.name, cameras), size.width * pictures, size.height, rate);
}

Status write_camera(const RefineVideos& videos, const RefineStore& store, const RefinedCamera& camera, size_t cameras)
{
    std::optional<Video> plain, beside;
    if (!videos.frames.empty()) {
        SR_TRY(Video video, open_video(videos.frames, camera, cameras, 1, videos.frames_per_second));
        plain.emplace(std::move(video));
    }
    if (!videos.side_by_side.empty()) {
        SR_TRY(Video video, open_video(videos.side_by_side, camera, cameras, 3, videos.frames_per_second));
        beside.emplace(std::move(video));
    }
    for (uint32_t f = camera.range.first; f <= camera.range.last; ++f) {
        SR_TRY(const ImageRgb8 frame, store.load_frame(camera.buffers, f));
        if (plain)
            SR_CHECK(plain->add(frame.pixels));
        if (!beside)
            continue;
        SR_TRY(const std::vector<uint8_t> labels, read_label_picture(camera.buffers, f));
        SR_TRY(const BufferFrame buffer, read_buffer(camera.buffers, f));
        const std::span<const uint8_t> pictures[] = {labels, buffer.color, frame.pixels};
        SR_CHECK(beside->add(joined(pictures, camera.buffers.size)));
    }
    if (plain)
        SR_CHECK(plain->finish());
    return beside ? beside->finish() : Status{};
}

} // namespace

std::vector<Path> video_files(const RefineVideos& videos, std::span<const RefinedCamera> cameras)
{
    std::vector<Path> files;
    for (const Path& video : {videos.frames, videos.side_by_side})
        for (const RefinedCamera& c : cameras)
            if (!video.empty())
                files.push_back(video_path(video, c.name, cameras.size()));
    return files;
}

Status write_videos(const RefineVideos& videos, const RefineStore& store, std::span<const RefinedCamera> cameras)
{
    for (const RefinedCamera& camera : cameras)
        if (videos.any())
            SR_CHECK(write_camera(videos, store, camera, cameras.size()));
    return {};
}

} // namespace semrover
