// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/outputs.h"

#include "engine/annotation/drive_record.h"
#include "runtime/base/final_name.h"
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"

namespace semrover {

namespace {

// the run.json of a run in that state, with these settings (null: any)
std::optional<Json> run_in(const Path& folder, std::string_view state, const Json& settings)
{
    const auto run = read_json(folder / "run.json");
    if (!run || !run->is_object() || run->value("state", Json()) != state ||
        (!settings.is_null() && run->value("settings", Json()) != settings))
        return std::nullopt;
    return *run;
}

} // namespace

Status check_writable(const Path& path, bool replace)
{
    SR_CHECK(refuse_existing(path, replace));
    return AtomicFile::create(path).map([](const AtomicFile&) {});
}

bool is_written(const Path& path)
{
    return examine(path).value_or(FileType::none) == FileType::regular;
}

std::optional<Json> finished_results(const Path& folder, const Json& settings)
{
    const auto run = run_in(folder, "finished", settings);
    if (!run)
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

bool goes_on(const Path& folder, const Json& settings)
{
    return run_in(folder, "running", settings).has_value();
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
    const bool restart = replace && !goes_on(folder, settings);
    return RunFolder::open(folder, settings, restart, contents, keep_finished);
}

} // namespace semrover
