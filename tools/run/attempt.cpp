// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/run/attempt.h"

#include "runtime/base/hash.h"
#include "runtime/base/quote.h"
#include "runtime/base/unfinished.h"
#include "runtime/system/host_name.h"
#include "runtime/system/system.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <random>

namespace semrover {

namespace {

namespace fs = std::filesystem;

constexpr const char* kWork = ".work";

Path attempts_of(const Path& out)
{
    return out / kWork;
}

// KEY.HOST.PID.RANDOM; a host's name may have dots, too
struct AttemptName {
    std::string key, host;
    long pid = 0;
};

std::optional<AttemptName> parse_name(const std::string& name)
{
    const size_t random = name.rfind('.'), pid = random == 0 ? name.npos : name.rfind('.', random - 1);
    const size_t host = name.find('.');
    if (random == name.npos || pid == name.npos || pid <= host)
        return std::nullopt;
    return AttemptName{name.substr(0, host), name.substr(host + 1, pid - host - 1),
                       std::strtol(name.c_str() + pid + 1, nullptr, 10)};
}

bool is_known_dead(const Path& attempt)
{
    const auto name = parse_name(attempt.filename().string());
    return name && name->host == host_name() && name->pid > 0 && system::process_is_gone(name->pid);
}

bool take_copy(const Path& from, const Path& to)
{
    return make_folder(to.parent_path()) && system::copy_file(from, to) == 0;
}

// a hard link, or a copy where the file system has none
bool take_file(const Path& from, const Path& to)
{
    if (!make_folder(to.parent_path()))
        return false;
    std::error_code error;
    fs::create_hard_link(from, to, error);
    return (!error || system::copy_file(from, to) == 0) && system::flush_folder(to.parent_path()) == 0;
}

// What a run goes on from, of an attempt that may be working, be published or be removed in the meantime. Its state is
// taken first: what the journal names is there then. `summary`, which its run.json holds, is another before anything of
// that goes away; false where it is
bool take_run(const Path& from, const Path& to, const Path& run, const Json& summary)
{
    if (!take_copy(from / run, to / run))
        return false;
    const Path journal = run.parent_path() / "journal.jsonl";
    if (is_there(from / journal) && !take_copy(from / journal, to / journal))
        return false;
    std::error_code error;
    std::vector<Path> files;
    for (fs::recursive_directory_iterator i(from, error), end; i != end; i.increment(error)) {
        const std::string name = i->path().filename().string();
        const Path file = i->path().lexically_relative(from);
        if (!i->is_symlink(error) && i->is_regular_file(error) && file != run && file != journal && name != "lock" &&
            !name.starts_with(".semrover-"))
            files.push_back(file);
    }
    if (error)
        return false;
    for (const Path& file : files)
        if (!take_file(from / file, to / file) && is_there(from / file))
            return false;
    const auto now = read_json(from / run);
    return now && *now == summary;
}

// by its name at once, so that nobody takes over a part of it
void remove_attempt(const Path& attempt)
{
    std::error_code error;
    const Path removed = attempt.parent_path() / unfinished_name();
    fs::rename(attempt, removed, error);
    fs::remove_all(error ? attempt : removed, error);
}

double seconds_since_change(const Path& folder)
{
    std::error_code error;
    fs::file_time_type last = fs::last_write_time(folder, error);
    for (fs::recursive_directory_iterator i(folder, error), end; i != end; i.increment(error))
        last = std::max(last, i->last_write_time(error));
    return std::chrono::duration<double>(fs::file_time_type::clock::now() - last).count();
}

} // namespace

Attempt::Attempt(Path out, std::string name)
    : out_(std::move(out)), folder_(attempts_of(out_) / name), work_(folder_ / "work"), files_(folder_ / "files"),
      name_(std::move(name))
{
}

Attempt::Attempt(Attempt&& other) noexcept = default;

Attempt::~Attempt()
{
    std::error_code ignored; // folders that hold anything stay
    for (const Path& folder : {work_, files_, folder_})
        if (!folder.empty())
            fs::remove(folder, ignored);
}

Result<Attempt> Attempt::create(const Path& out, const std::string& key)
{
    std::random_device random;
    const uint64_t number = uint64_t(random()) << 32 | random();
    Attempt attempt(out, fmt::format("{}.{}.{}.{}", key, host_name(), system::process_number(), hash_text(number)));
    SR_CHECK(make_folder(attempt.folder_));
    return attempt;
}

std::vector<Path> Attempt::older() const
{
    const std::string key = name_.substr(0, name_.find('.'));
    std::vector<std::pair<fs::file_time_type, Path>> found;
    std::error_code error;
    for (fs::directory_iterator i(attempts_of(out_), error), end; i != end; i.increment(error))
        if (const auto name = parse_name(i->path().filename().string());
            name && name->key == key && i->path() != folder_)
            found.emplace_back(i->last_write_time(error), i->path());
    std::ranges::sort(found, std::greater());
    std::vector<Path> paths;
    for (auto& [time, path] : found)
        paths.push_back(std::move(path));
    return paths;
}

bool Attempt::adopt(const Path& run, const std::string& device, const std::string& driver,
                    const std::function<void(const std::string&)>& say)
{
    for (const Path& other : older()) {
        const auto summary = read_json(other / "work" / run);
        if (!summary || !summary->is_object() || !summary->value("settings", Json()).is_object())
            continue;
        const Json& settings = (*summary)["settings"];
        if (settings.value("device", Json()) != device || settings.value("driver", Json()) != driver) {
            say(fmt::format("{} is of another device, {}: it is not gone on with", quote_path(other),
                            json_text(settings.value("device", Json()))));
            continue;
        }
        if (take_run(other / "work", work_, run, *summary)) {
            if (is_known_dead(other))
                remove_attempt(other);
            return true;
        }
        std::error_code ignored;
        fs::remove_all(work_, ignored);
    }
    return false;
}

// into files(); false: it has not all of it
bool Attempt::take_finished(const Path& from, const std::string& key)
{
    const auto manifest = read_manifest(from);
    if (!manifest || manifest->key != key || !differences(from, *manifest).empty())
        return false;
    const bool all = std::ranges::all_of(
        manifest->files, [&](const Manifest::File& file) { return take_file(from / file.path, files_ / file.path); });
    Manifest own = *manifest;
    own.attempt = name_;
    own.adopted = true;
    if (all && differences(files_, own).empty() && write_manifest(files_, own))
        return true;
    std::error_code ignored;
    fs::remove_all(files_, ignored);
    return false;
}

bool Attempt::adopt_finished(const std::string& key)
{
    const std::vector<Path> others = older();
    return std::ranges::any_of(others, [&](const Path& other) {
        return take_finished(other / "files", key) || take_finished(other / "work", key);
    });
}

Result<Attempt::Published> Attempt::publish(const std::string& name, const std::string& key)
{
    const Path to = out_ / name;
    SR_CHECK(make_folder(to.parent_path()));
    const int failed = system::rename_surely(files_, to);
    (void)system::flush_folder(to.parent_path());
    const auto there = read_manifest(to);
    if (there && there->attempt == name_) {
        for (const Path& other : older())
            if (is_known_dead(other))
                remove_attempt(other);
        remove_attempt(folder_);
        return Published::by_this;
    }
    if (there && there->key == key) {
        remove_attempt(folder_);
        return Published::by_another;
    }
    if (there)
        return fail(ErrorCode::bad_input, "{} was made with other settings; -y moves it aside", quote_path(to));
    return fail(ErrorCode::bad_input, "cannot rename {} to {}: {}", quote_path(files_), quote_path(to),
                system::message_of(failed ? failed : ENOENT));
}

size_t Attempt::clean(const Path& out, double seconds, const std::function<bool(const std::string& key)>& is_done)
{
    size_t removed = 0;
    std::error_code error;
    std::vector<Path> all;
    for (fs::directory_iterator i(attempts_of(out), error), end; i != end; i.increment(error))
        all.push_back(i->path());
    for (const Path& attempt : all) {
        const auto name = parse_name(attempt.filename().string());
        if (is_abandoned(attempt) || (name && is_done(name->key) && seconds_since_change(attempt) >= seconds)) {
            remove_attempt(attempt);
            ++removed;
        }
    }
    return removed;
}

std::set<std::string> Attempt::keys(const Path& out)
{
    std::set<std::string> keys;
    std::error_code error;
    for (fs::directory_iterator i(attempts_of(out), error), end; i != end; i.increment(error))
        if (const auto name = parse_name(i->path().filename().string()))
            keys.insert(name->key);
    return keys;
}

} // namespace semrover
