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

Result<Video> open_video(const Path& file, const RefineChain& chain, size_t chains, uint32_t pictures, int rate)
{
    const ImageSize& size = chain.camera.size;
    return Video::create(video_path(file, chain.camera.name, chains), size.width * pictures, size.height, rate);
}

Status write_chain(const RefineVideos& videos, const RefineStore& store, const RefineChain& chain, size_t chains)
{
    std::optional<Video> plain, beside;
    if (!videos.frames.empty()) {
        SR_TRY(Video video, open_video(videos.frames, chain, chains, 1, videos.frames_per_second));
        plain.emplace(std::move(video));
    }
    if (!videos.side_by_side.empty()) {
        SR_TRY(Video video, open_video(videos.side_by_side, chain, chains, 3, videos.frames_per_second));
        beside.emplace(std::move(video));
    }
    for (uint32_t f = chain.range.first; f <= chain.range.last; ++f) {
        SR_TRY(const ImageRgb8 frame, store.load_frame(chain.camera, f));
        if (plain)
            SR_CHECK(plain->add(frame.pixels));
        if (!beside)
            continue;
        SR_TRY(const std::vector<uint8_t> labels, read_label_picture(chain.camera, f));
        SR_TRY(const BufferFrame buffer, read_buffer(chain.camera, f));
        const std::span<const uint8_t> pictures[] = {labels, buffer.color, frame.pixels};
        SR_CHECK(beside->add(joined(pictures, chain.camera.size)));
    }
    if (plain)
        SR_CHECK(plain->finish());
    return beside ? beside->finish() : Status{};
}

} // namespace

std::vector<Path> video_files(const RefineVideos& videos, std::span<const RefineChain> chains)
{
    std::vector<Path> files;
    for (const Path& video : {videos.frames, videos.side_by_side})
        for (const RefineChain& c : chains)
            if (!video.empty())
                files.push_back(video_path(video, c.camera.name, chains.size()));
    return files;
}

Status write_videos(const RefineVideos& videos, const RefineStore& store, std::span<const RefineChain> chains)
{
    for (const RefineChain& chain : chains)
        if (videos.any())
            SR_CHECK(write_chain(videos, store, chain, chains.size()));
    return {};
}

} // namespace semrover
