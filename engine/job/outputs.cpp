// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/outputs.h"

#include "runtime/base/quote.h"

namespace semrover {

Status check_writable(const Path& path, bool replace)
{
    if (std::filesystem::exists(path) && !replace)
        return fail(ErrorCode::usage, "{} exists; -y replaces it", quote_path(path));
    return AtomicFile::create(path).map([](const AtomicFile&) {});
}

Result<RunFolder> open_run(const Path& folder, const Json& settings, bool replace, const RunContents& contents)
{
    if (!replace)
        return RunFolder::open(folder, settings, false, contents);
    const auto before = read_json(folder / "run.json");
    const bool same = before && before->is_object() && before->value("settings", Json()) == settings &&
                      before->value("state", Json()) == "running";
    return RunFolder::open(folder, settings, !same, contents);
}

} // namespace semrover
