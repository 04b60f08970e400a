// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/final_name.h"

#include "runtime/base/quote.h"
#include "runtime/system/system.h"

namespace semrover {

Path folder_of(const Path& path)
{
    return path.has_parent_path() ? path.parent_path() : Path(".");
}

Status flush_names(const Path& folder)
{
    if (const int error = system::flush_folder(folder))
        return fail(ErrorCode::bad_input, "cannot flush folder {}: {}", quote_path(folder), system::message_of(error));
    return {};
}

Status refuse_existing(const Path& path, bool replace)
{
    if (replace)
        return {};
    SR_TRY(const FileType type, examine(path));
    if (type != FileType::not_found)
        return fail(ErrorCode::usage, "{} exists; `replace` replaces it", quote_path(path));
    return {};
}

Result<bool> has_folder(const Path& path)
{
    SR_TRY(const FileType type, examine(path));
    if (type != FileType::not_found && type != FileType::directory)
        return fail(ErrorCode::bad_input, "{} is a file; a folder is needed", quote_path(path));
    return type == FileType::directory;
}

Status rename_whole(const Path& from, const Path& to)
{
    if (const int error = system::rename_surely(from, to))
        return fail(ErrorCode::bad_input, "cannot write {}: {}", quote_path(to), system::message_of(error));
    return flush_names(folder_of(to));
}

} // namespace semrover
