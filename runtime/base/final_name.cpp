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
    std::error_code error;
    const auto type = std::filesystem::status(path, error).type();
    if (type == std::filesystem::file_type::none)
        return fail(ErrorCode::bad_input, "cannot examine {}: {}", quote_path(path), error.message());
    if (type != std::filesystem::file_type::not_found)
        return fail(ErrorCode::usage, "{} exists; `replace` replaces it", quote_path(path));
    return {};
}

Status rename_whole(const Path& from, const Path& to)
{
    if (const int error = system::rename_surely(from, to))
        return fail(ErrorCode::bad_input, "cannot write {}: {}", quote_path(to), system::message_of(error));
    return flush_names(folder_of(to));
}

} // namespace semrover
