// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"
#include "runtime/system/process.h"

#include <memory>
#include <span>
#include <string>

namespace semrover {

// An H.264 MP4 through an ffmpeg child process, which gets raw frames on its standard input; no shell. Written under a
// temporary name and renamed by finish().
class Video {
  public:
    // bad_input when ffmpeg is not installed (with the package's name)
    static Result<Video> create(const Path& path, uint32_t width, uint32_t height, int frames_per_second);
    Video(Video&& other) noexcept;
    Video& operator=(Video&&) = delete;
    ~Video();

    Status add(std::span<const uint8_t> rgb); // [height, width, 3]
    Status finish();

  private:
    Video() = default;

    Path path_, temporary_;
    std::unique_ptr<system::Process> child_; // while ffmpeg runs
    std::unique_ptr<Unfinished> unfinished_;
};

} // namespace semrover
