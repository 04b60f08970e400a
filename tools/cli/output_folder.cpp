// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/output_folder.h"

#include "runtime/base/final_name.h"
#include "runtime/base/quote.h"

namespace semrover {

namespace fs = std::filesystem;

Result<OutputFolder> OutputFolder::create(const Path& path, bool replace)
{
    OutputFolder f;
    std::error_code error;
    f.path_ = fs::absolute(path, error);
    if (!f.path_.has_filename())
        f.path_ = f.path_.parent_path(); // "name/"
    SR_TRY(const bool there, has_folder(f.path_));
    if (there && !replace)
        return fail(ErrorCode::usage, "{} exists; -y replaces what is written there", quote_path(path));
    for (int attempt = 0; attempt < 100; ++attempt) { // a killed run with the same pid may have left its name
        const Path name = f.path_.parent_path() / unfinished_name();
        const Together created_and_known;
        if (fs::create_directory(name, error)) { // the umask decides, as for files
            f.temporary_ = name;
            f.unfinished_ = std::make_unique<Unfinished>(name);
            return f;
        }
        if (error)
            break;
    }
    return fail(ErrorCode::bad_input, "cannot create a folder in {}: {}", quote_path(f.path_.parent_path()),
                error ? error.message() : "a file of each name is there");
}

OutputFolder::OutputFolder(OutputFolder&& other) noexcept
    : path_(std::move(other.path_)), temporary_(std::exchange(other.temporary_, {})),
      unfinished_(std::move(other.unfinished_))
{
}

OutputFolder::~OutputFolder()
{
    std::error_code error;
    if (!temporary_.empty())
        fs::remove_all(temporary_, error);
}

Status OutputFolder::commit()
{
    const Together renamed_and_forgotten;
    if (!is_there(path_)) {
        SR_CHECK(rename_whole(temporary_, path_));
        temporary_.clear();
        return {};
    }
    std::error_code error;
    std::vector<Path> names;
    for (fs::directory_iterator i(temporary_, error), end; !error && i != end; i.increment(error))
        names.push_back(i->path().filename());
    if (error)
        return fail(ErrorCode::bad_input, "cannot list {}: {}", quote_path(temporary_), error.message());
    for (const Path& name : names)
        SR_CHECK(replace(name));
    return {};
}

// what was there goes with the temporary folder, or comes back
Status OutputFolder::replace(const Path& name) const
{
    const Path from = temporary_ / name, to = path_ / name, before = temporary_ / (".before-" + name.string());
    std::error_code error;
    fs::rename(to, before, error);
    const bool moved = !error;
    if (error && error != std::errc::no_such_file_or_directory)
        return fail(ErrorCode::bad_input, "cannot replace {}: {}", quote_path(to), error.message());
    const Status renamed = rename_whole(from, to);
    if (!renamed && moved && !fs::exists(to, error))
        fs::rename(before, to, error);
    return renamed;
}

} // namespace semrover
