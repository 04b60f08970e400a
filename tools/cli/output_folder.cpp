// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/output_folder.h"

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
    if (fs::exists(f.path_, error) && !fs::is_directory(f.path_, error))
        return fail(ErrorCode::bad_input, "{} is a file; a folder is needed", quote_path(path));
    if (fs::exists(f.path_, error) && !replace)
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
    std::error_code error;
    if (!fs::exists(path_, error)) {
        fs::rename(temporary_, path_, error);
        if (!error)
            temporary_.clear();
    } else {
        for (const auto& entry : fs::directory_iterator(temporary_, error)) {
            const Path to = path_ / entry.path().filename();
            fs::remove_all(to, error);
            fs::rename(entry.path(), to, error);
            if (error)
                break;
        }
    }
    if (error)
        return fail(ErrorCode::bad_input, "cannot write {}: {}", quote_path(path_), error.message());
    return {};
}

} // namespace semrover
