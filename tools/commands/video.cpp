// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/commands/video.h"

#include "runtime/base/final_name.h"
#include "runtime/base/quote.h"

#include <cerrno>
#include <vector>

namespace semrover {

namespace {

Result<system::Process> start_ffmpeg(const std::vector<std::string>& arguments)
{
    auto child = system::Process::start("ffmpeg", arguments, system::Process::Pipe::input);
    if (!child && child.error() == ENOENT)
        return fail(ErrorCode::bad_input, "--video needs ffmpeg, which is not installed (Debian: ffmpeg)");
    if (!child)
        return fail(ErrorCode::bad_input, "cannot start ffmpeg: {}", system::message_of(child.error()));
    return std::move(*child);
}

Status flush_and_rename(const Path& from, const Path& to)
{
    auto file = system::File::open(from, system::FileUse::append);
    const int error = file ? file->flush() : file.error();
    if (error)
        return fail(ErrorCode::bad_input, "cannot write {}: {}", quote_path(to), system::message_of(error));
    return rename_whole(from, to);
}

} // namespace

Result<Video> Video::create(const Path& path, uint32_t width, uint32_t height, int frames_per_second)
{
    Video v;
    v.path_ = path;
    v.temporary_ = path.parent_path() / unfinished_name();
    const std::vector<std::string> arguments = {
        "ffmpeg", "-loglevel", "error", "-xerror", "-y", "-f", "rawvideo", "-pixel_format", "rgb24", "-video_size",
        fmt::format("{}x{}", width, height), "-framerate", std::to_string(frames_per_second), "-i", "-",
        // H.264 in 4:2:0 wants even sides
        "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-c:v", "libx264", "-crf", "18", "-pix_fmt", "yuv420p", "-f", "mp4",
        // note: a name alone may look like an option or an address, such as -o/v.mp4 or tcp://host/v.mp4
        "-movflags", "+faststart", "file:" + v.temporary_.string()};
    const Together started_and_known;
    SR_TRY(system::Process child, start_ffmpeg(arguments));
    v.child_ = std::make_unique<system::Process>(std::move(child));
    v.unfinished_ = std::make_unique<Unfinished>(v.temporary_, [id = v.child_->id()] { system::Process::kill(id); });
    return v;
}

Video::Video(Video&& other) noexcept = default;

Video::~Video()
{
    if (!child_)
        return;
    child_.reset(); // before its file
    system::remove_file(temporary_);
}

// note: an ffmpeg that died is an error of the write (system::prepare_streams)
Status Video::add(std::span<const uint8_t> rgb)
{
    if (const int error = child_->pipe.write(std::as_bytes(rgb)))
        return fail(ErrorCode::bad_input, "ffmpeg stopped reading frames for {}: {}", quote_path(path_),
                    system::message_of(error));
    return {};
}

Status Video::finish()
{
    const int code = child_->wait();
    const Together renamed_and_forgotten;
    child_.reset();
    unfinished_.reset();
    Status done = code == 0 ? flush_and_rename(temporary_, path_)
                            : fail(ErrorCode::bad_input, "ffmpeg could not write {}", quote_path(path_));
    if (!done)
        system::remove_file(temporary_);
    return done;
}

} // namespace semrover
