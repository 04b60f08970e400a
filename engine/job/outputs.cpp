// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/outputs.h"

#include "engine/annotation/drive_record.h"
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"

namespace semrover {

Status check_writable(const Path& path, bool replace)
{
    if (is_there(path) && !replace)
        return fail(ErrorCode::usage, "{} exists; `replace` replaces it", quote_path(path));
    return AtomicFile::create(path).map([](const AtomicFile&) {});
}

std::optional<Json> finished_results(const Path& folder, const Json& settings)
{
    const auto run = read_json(folder / "run.json");
    if (!run || !run->is_object() || run->value("state", Json()) != "finished" ||
        (!settings.is_null() && run->value("settings", Json()) != settings))
        return std::nullopt;
    const Json results = run->value("results", Json::object());
    return results.is_object() ? std::optional(results) : std::nullopt;
}

std::optional<Json> finished_results(const Path& folder, const Json& settings, const Path& output)
{
    std::optional<Json> results = finished_results(folder, settings);
    if (!results)
        return results;
    const auto hash = hash_file(output);
    if (!hash || results->value("xxh64", Json()) != hash_text(*hash))
        results.reset();
    return results;
}

Status write_record_of(const CameraPath& path, double depth_unit, const Path& folder, const JobCallbacks& callbacks)
{
    const auto record = drive_record_of(path, depth_unit);
    if (record)
        return write_drive_record(folder, *record);
    if (callbacks.warning)
        callbacks.warning(
            fmt::format("no {} of this path: {}", fmt::join(kDriveRecordFiles, ", "), record.error().message));
    return {};
}

Result<RunFolder> open_run(const Path& folder, const Json& settings, bool replace, const RunContents& contents,
                           bool keep_finished)
{
    bool restart = false;
    if (replace) {
        const auto before = read_json(folder / "run.json");
        restart = !(before && before->is_object() && before->value("settings", Json()) == settings &&
                    before->value("state", Json()) == "running");
    }
    return RunFolder::open(folder, settings, restart, contents, keep_finished);
}

} // namespace semrover
