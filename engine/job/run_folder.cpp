// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/run_folder.h"

#include "engine/shards/shard_set.h"
#include "runtime/base/diagnostics.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cerrno>
#include <mutex>

namespace semrover {

namespace {

namespace fs = std::filesystem;

constexpr uint64_t kMaxJournalBytes = 1ull << 30;

tl::unexpected<Error> system_failure(const char* what, const Path& path, int error)
{
    return fail(ErrorCode::bad_input, "cannot {} {}: {}", what, quote_path(path), system::message_of(error));
}

tl::unexpected<Error> is_a_link(const Path& path)
{
    return fail(ErrorCode::bad_input, "{} is a link: the state of a run lies in the run's folder itself; remove it",
                quote_path(path));
}

Result<system::File> open_own(const Path& path, system::FileUse use)
{
    auto file = system::File::open(path, use);
    if (!file)
        return file.error() == ELOOP ? is_a_link(path) : system_failure("open", path, file.error());
    const auto facts = file->facts();
    if (!facts)
        return system_failure("open", path, facts.error());
    if (!facts->regular)
        return fail(ErrorCode::bad_input, "cannot open {}: expected a file, found a device or pipe", quote_path(path));
    return std::move(*file);
}

// Whether the name is still that of the file. A process that ends removes its lock: whoever opened that one before, and
// gets it now, has the lock of nothing
Result<bool> leads_to(const Path& path, const system::File& file)
{
    const auto opened = file.facts(), there = system::facts_of(path);
    if (!there && there.error() == ENOENT)
        return false;
    if (!opened || !there)
        return system_failure("examine", path, !opened ? opened.error() : there.error());
    return opened->is(*there);
}

void warn_without_locks(const Path& folder, int error)
{
    static std::once_flag said;
    std::call_once(said, [&] {
        diagnose(
            fmt::format("semrover: warning: {} is on a file system without locks ({}): a second process that works "
                        "there at the same time is not noticed",
                        quote_path(folder), system::message_of(error)));
    });
}

// the settings and the state of a run.json
Result<Json> read_summary(const Path& path)
{
    auto summary = read_json(path);
    if (!summary)
        return fail(summary.error().code, "{}; start over with `replace`", summary.error().message);
    if (!summary->is_object() || !summary->value("settings", Json()).is_object() ||
        !summary->value("state", Json()).is_string())
        return fail(ErrorCode::bad_input,
                    "{}: expected an object with the settings and the state of a run; start over with `replace`",
                    quote_path(path));
    return std::move(*summary);
}

tl::unexpected<Error> other_settings(const Path& folder, bool finished)
{
    if (finished)
        return fail(ErrorCode::usage,
                    "{} exists, a run with other settings, model, input or device; `replace` replaces it",
                    quote_path(folder));
    return fail(ErrorCode::bad_input,
                "{} holds a run with other settings, model, input or device; finish that one, name another output, or "
                "start over with `replace`",
                quote_path(folder));
}

// NNNNNN.png, .jpg, .npy and points of lidars, then the folder and the camera's around it if there is nothing else. The
// run's own folder holds its lock.
void remove_numbered(const Path& folder)
{
    std::error_code ignored;
    for (const Path& file : list_files(folder).value_or(std::vector<Path>())) {
        const std::string name = file.filename().string(), stem = name.substr(0, name.find('.'));
        static constexpr std::string_view kEndings[] = {".png", ".jpg", ".npy", ".bin", ".pcd", ".pcd.bin"};
        const bool ours = std::ranges::count(kEndings, name.substr(stem.size())) > 0;
        if (ours && stem.size() == 6 && std::ranges::all_of(stem, ::isdigit))
            fs::remove(file, ignored);
    }
    fs::remove(folder, ignored); // stays if it holds anything else
    fs::remove(folder.parent_path(), ignored);
}

} // namespace

RunFolder::~RunFolder()
{
    std::error_code ignored;
    if (lock_ && results_) // finish() removed it before
        fs::remove(path_ / "lock", ignored);
}

Result<RunFolder> RunFolder::open(const Path& folder, const Json& settings, bool restart, const RunContents& contents,
                                  bool keep_finished)
{
    RunFolder run;
    run.path_ = folder;
    run.settings_ = settings;
    run.contents_ = contents;
    SR_TRY(const ShardsOrNone shards, open_if_shards(folder));
    if (shards)
        return fail(ErrorCode::usage, "{} is a shard set, which is read only: expected another output",
                    quote_path(shards->folder()));
    std::error_code ignored;
    if (fs::is_symlink(folder, ignored))
        return fail(ErrorCode::bad_input, "{} is a link: expected the folder itself, or its name with a / behind it",
                    quote_path(folder));
    SR_CHECK(make_folder(folder));
    SR_CHECK(run.refuse_links());
    SR_CHECK(run.lock());
    if (is_there(folder / "run.json") && !restart) {
        SR_TRY(const Json before, read_summary(folder / "run.json"));
        const bool finished = before.value("state", Json()) == "finished";
        if (before.value("settings", Json()) != settings)
            return other_settings(folder, finished);
        if (finished && keep_finished)
            run.results_ = before.value("results", Json::object());
        SR_CHECK(finished && !keep_finished ? run.start() : run.read_journal());
    } else {
        SR_CHECK(run.start());
    }
    for (const std::string& name : run.names())
        remove_temporary_files(folder / name);
    SR_TRY(run.journal_, open_own(folder / "journal.jsonl", system::FileUse::append));
    if (const int error = system::flush_folder(folder)) // the journal's name
        return system_failure("flush", folder, error);
    return run;
}

Status RunFolder::refuse_links() const
{
    std::vector<std::string> names = {"run.json", "journal.jsonl", "lock"};
    std::ranges::copy(this->names(), std::back_inserter(names));
    std::error_code ignored;
    for (const std::string& name : names) {
        if (fs::is_symlink(path_ / name, ignored))
            return is_a_link(path_ / name);
        SR_TRY(const FileType type, examine(path_ / name));
        if (type != FileType::directory)
            continue;
        std::error_code error;
        for (fs::recursive_directory_iterator i(path_ / name, error), end; !error && i != end; i.increment(error))
            if (i->is_symlink(ignored))
                return is_a_link(i->path());
        if (error)
            return fail(ErrorCode::bad_input, "cannot list {}: {}", quote_path(path_ / name), error.message());
    }
    return {};
}

Status RunFolder::lock()
{
    const Path path = path_ / "lock";
    for (;;) {
        SR_TRY(lock_, open_own(path, system::FileUse::lock));
        const int error = lock_.lock();
        if (error == EWOULDBLOCK)
            return fail(ErrorCode::busy, "another process works in {}", quote_path(path_));
        if (error && !system::says_no_locks(error))
            return system_failure("lock", path, error);
        if (error) {
            warn_without_locks(path_, error);
            return {};
        }
        SR_TRY(const bool stands, leads_to(path, lock_));
        if (stands)
            return {};
    }
}

std::vector<std::string> RunFolder::names() const
{
    std::vector<std::string> names = contents_.pieces;
    names.insert(names.end(), contents_.results.begin(), contents_.results.end());
    names.insert(names.end(), contents_.numbered.begin(), contents_.numbered.end());
    return names;
}

// only names that runs make
void RunFolder::remove_contents() const
{
    std::error_code ignored;
    for (const auto* names : {&contents_.pieces, &contents_.results})
        for (const std::string& name : *names)
            fs::remove_all(path_ / name, ignored);
    for (const std::string& name : contents_.numbered)
        remove_numbered(path_ / name);
    fs::remove(path_ / "journal.jsonl", ignored);
    fs::remove(path_ / "run.json", ignored);
}

Status RunFolder::start()
{
    remove_contents(); // of an earlier run
    return write_file_atomically(path_ / "run.json",
                                 json_text(Json{{"settings", settings_}, {"state", "running"}}, 1) + "\n");
}

// a line that is not whole (the process died while writing it) ends the journal; the file is cut there
Status RunFolder::read_journal()
{
    const Path path = path_ / "journal.jsonl";
    if (!is_there(path))
        return {};
    SR_TRY(const std::string text, read_text_file(path, kMaxJournalBytes));
    size_t at = 0;
    while (at < text.size()) {
        const size_t end = text.find('\n', at);
        if (end == std::string::npos)
            break;
        auto entry = parse_json(std::string_view(text).substr(at, end - at), "journal");
        if (!entry)
            break;
        entries_.push_back(std::move(*entry));
        at = end + 1;
    }
    const int error = at < text.size() ? system::cut(path, at) : 0;
    if (error)
        return system_failure("cut", path, error);
    return {};
}

Status RunFolder::append(const Json& entry)
{
    const std::string line = json_text(entry) + "\n";
    int error = journal_.write(std::as_bytes(std::span(line)));
    if (!error)
        error = journal_.flush();
    if (error)
        return system_failure("write", path_ / "journal.jsonl", error);
    appended_ = true;
    return {};
}

void RunFolder::drop_if_empty()
{
    if (appended_ || !entries_.empty() || results_)
        return;
    remove_contents(); // what nobody can go on from
    std::error_code ignored;
    fs::remove(path_ / "lock", ignored);
    fs::remove(path_, ignored); // stays if it holds anything else
}

Status RunFolder::finish(const Json& results)
{
    const Json summary{{"settings", settings_}, {"state", "finished"}, {"results", results}};
    SR_CHECK(write_file_atomically(path_ / "run.json", json_text(summary, 1) + "\n"));
    std::error_code ignored; // what stays only costs space
    for (const std::string& name : contents_.pieces)
        fs::remove_all(path_ / name, ignored);
    fs::remove(path_ / "lock", ignored);
    return {};
}

Json device_key(const Device& device)
{
    return {{"device", device.name()}, {"driver", device.driver()}, {"kernels", kernels_text(device.limits())}};
}

} // namespace semrover
