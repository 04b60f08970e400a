// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/run/manifest.h"

#include "runtime/base/hash.h"
#include "runtime/base/inner_path.h"
#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

namespace fs = std::filesystem;

constexpr const char* kName = "manifest.json";
constexpr const char* kFormat = "semrover.manifest";

bool stays_inside(const std::string& path)
{
    return leads_inside(path) && Path(path).lexically_normal() == Path(path);
}

} // namespace

Result<Manifest> read_manifest(const Path& folder)
{
    const Path path = folder / kName;
    SR_TRY(const Json json, read_json(path));
    const auto wrong = [&] { return fail(ErrorCode::bad_input, "{}: not a manifest of ours", quote_path(path)); };
    if (!json.is_object() || json.value("format", Json()) != kFormat || json.value("version", Json()) != 1)
        return wrong();
    try {
        Manifest m;
        const auto text = [&](const char* key) { return json.at(key).get<std::string>(); };
        m.task = text("task");
        m.key = text("key");
        m.attempt = text("attempt");
        m.host = text("host");
        m.device = text("device");
        m.driver = text("driver");
        m.begun = text("begun");
        m.seconds = json.at("seconds").get<double>();
        m.adopted = json.at("adopted").get<bool>();
        for (const Json& file : json.at("files"))
            m.files.push_back({file.at("path").get<std::string>(), file.at("bytes").get<uint64_t>(),
                               file.at("xxh64").get<std::string>()});
        if (!std::ranges::all_of(m.files, stays_inside, &Manifest::File::path))
            return wrong();
        return m;
    } catch (const Json::exception&) {
        return wrong();
    }
}

Status write_manifest(const Path& folder, const Manifest& m)
{
    Json files = Json::array();
    for (const Manifest::File& file : m.files)
        files.push_back({{"path", file.path}, {"bytes", file.bytes}, {"xxh64", file.xxh64}});
    const Json json{{"format", kFormat},    {"version", 1},         {"task", m.task},       {"key", m.key},
                    {"attempt", m.attempt}, {"host", m.host},       {"device", m.device},   {"driver", m.driver},
                    {"begun", m.begun},     {"seconds", m.seconds}, {"adopted", m.adopted}, {"files", files}};
    return write_file_atomically(folder / kName, json_text(json, 1) + "\n");
}

Result<std::vector<Manifest::File>> list_contents(const Path& folder, std::span<const char* const> skip)
{
    std::vector<Manifest::File> files;
    std::error_code error;
    for (fs::recursive_directory_iterator i(folder, error), end; i != end; i.increment(error)) {
        if (i.depth() == 0 && std::ranges::count(skip, i->path().filename().string())) {
            i.disable_recursion_pending();
            continue;
        }
        if (i->is_symlink(error) || (!i->is_regular_file(error) && !i->is_directory(error)))
            return fail(ErrorCode::bad_input, "{}: neither a file nor a folder", quote_path(i->path()));
        const std::string path = i->path().lexically_relative(folder).generic_string();
        if (i->is_directory(error) || path == kName)
            continue;
        SR_TRY(const uint64_t hash, hash_file(i->path()));
        files.push_back({path, i->file_size(error), hash_text(hash)});
    }
    if (error)
        return fail(ErrorCode::bad_input, "cannot list {}: {}", quote_path(folder), error.message());
    std::ranges::sort(files, {}, &Manifest::File::path);
    return files;
}

std::vector<std::string> differences(const Path& folder, const Manifest& manifest)
{
    const auto there = list_contents(folder);
    if (!there)
        return {there.error().message};
    std::vector<std::string> lines;
    std::map<std::string, Manifest::File> rest;
    for (const Manifest::File& file : *there)
        rest[file.path] = file;
    for (const Manifest::File& file : manifest.files) {
        const auto found = rest.find(file.path);
        if (found == rest.end())
            lines.push_back(fmt::format("{} is missing", quote_path(folder / file.path)));
        else if (found->second != file)
            lines.push_back(fmt::format("{} has other bytes", quote_path(folder / file.path)));
        rest.erase(file.path);
    }
    for (const auto& [path, file] : rest)
        lines.push_back(fmt::format("{} is not of it", quote_path(folder / path)));
    return lines;
}

} // namespace semrover
