// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/final_name.h"

#include "runtime/base/quote.h"
#include "runtime/system/system.h"

namespace semrover {

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
    const Path folder = to.has_parent_path() ? to.parent_path() : Path(".");
    int error = system::rename_surely(from, to);
    if (!error)
        error = system::flush_folder(folder);
    if (error)
        return fail(ErrorCode::bad_input, "cannot write {}: {}", quote_path(to), system::message_of(error));
    return {};
}

} // namespace semrover
