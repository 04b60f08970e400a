// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/run_folder.h"

#include "engine/shards/shard_set.h"
#include "runtime/base/diagnostics.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <mutex>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

namespace semrover {

namespace {

namespace fs = std::filesystem;

constexpr uint64_t kMaxJournalBytes = 1ull << 30;

tl::unexpected<Error> system_failure(const char* what, const Path& path)
{
    return fail(ErrorCode::bad_input, "cannot {} {}: {}", what, quote_path(path), std::strerror(errno));
}

tl::unexpected<Error> is_a_link(const Path& path)
{
    return fail(ErrorCode::bad_input, "{} is a link: the state of a run lies in the run's folder itself; remove it",
                quote_path(path));
}

// note: what others put there may be a link to any file of the user's, or a pipe that nobody writes to
Result<int> open_own(const Path& path, int flags)
{
    const int fd = ::open(path.c_str(), flags | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0666);
    if (fd < 0 && errno == ELOOP)
        return is_a_link(path);
    struct stat status;
    if (fd < 0 || ::fstat(fd, &status) != 0)
        return system_failure("open", path);
    if (S_ISREG(status.st_mode))
        return fd;
    ::close(fd);
    return fail(ErrorCode::bad_input, "cannot open {}: expected a file, found a device or pipe", quote_path(path));
}

// of flock: the file system has none, as NFS and Lustre often are mounted
bool says_no_locks(int error)
{
    return error == ENOLCK || error == ENOSYS || error == EOPNOTSUPP || error == EBADF;
}

void warn_without_locks(const Path& folder, int error)
{
    static std::once_flag said;
    std::call_once(said, [&] {
        diagnose(
            fmt::format("semrover: warning: {} is on a file system without locks ({}): a second process that works "
                        "there at the same time is not noticed",
                        quote_path(folder), std::strerror(error)));
    });
}

// the settings and the state of a run.json
Result<Json> read_summary(const Path& path)
{
    SR_TRY(Json summary, read_json(path));
    if (!summary.is_object() || !summary.value("settings", Json()).is_object() ||
        !summary.value("state", Json()).is_string())
        return fail(ErrorCode::bad_input,
                    "{}: expected an object with the settings and the state of a run; start over with `replace`",
                    quote_path(path));
    return summary;
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
    std::vector<Path> files;
    for (const auto& entry : fs::directory_iterator(folder, ignored)) {
        const std::string name = entry.path().filename().string(), stem = name.substr(0, name.find('.'));
        static constexpr std::string_view kEndings[] = {".png", ".jpg", ".npy", ".bin", ".pcd", ".pcd.bin"};
        const bool ours = std::ranges::count(kEndings, name.substr(stem.size())) > 0;
        if (ours && stem.size() == 6 && std::ranges::all_of(stem, ::isdigit))
            files.push_back(entry.path());
    }
    for (const Path& file : files)
        fs::remove(file, ignored);
    fs::remove(folder, ignored); // stays if it holds anything else
    fs::remove(folder.parent_path(), ignored);
}

} // namespace

RunFolder::RunFolder(RunFolder&& other) noexcept
    : path_(std::move(other.path_)), settings_(std::move(other.settings_)), contents_(std::move(other.contents_)),
      entries_(std::move(other.entries_)), results_(std::move(other.results_)), appended_(other.appended_),
      lock_(std::exchange(other.lock_, -1)), journal_(std::exchange(other.journal_, -1))
{
}

RunFolder::~RunFolder()
{
    if (journal_ >= 0)
        ::close(journal_);
    std::error_code ignored;
    if (lock_ >= 0 && results_) // finish() removed it before
        fs::remove(path_ / "lock", ignored);
    if (lock_ >= 0)
        ::close(lock_); // the kernel drops the lock, also when the process is killed
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
    SR_CHECK(make_folder(folder));
    SR_CHECK(run.refuse_links());
    SR_CHECK(run.lock());
    if (fs::exists(folder / "run.json") && !restart) {
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
    SR_TRY(run.journal_, open_own(folder / "journal.jsonl", O_WRONLY | O_APPEND));
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
        fs::recursive_directory_iterator inside(path_ / name, ignored); // a file's, or an absent folder's: at its end
        for (; inside != fs::recursive_directory_iterator(); inside.increment(ignored))
            if (inside->is_symlink(ignored))
                return is_a_link(inside->path());
    }
    return {};
}

Status RunFolder::lock()
{
    const Path path = path_ / "lock";
    SR_TRY(lock_, open_own(path, O_RDWR));
    if (::flock(lock_, LOCK_EX | LOCK_NB) == 0)
        return {};
    if (errno == EWOULDBLOCK)
        return fail(ErrorCode::busy, "another process works in {}", quote_path(path_));
    if (!says_no_locks(errno))
        return system_failure("lock", path);
    warn_without_locks(path_, errno);
    return {};
}

std::vector<std::string> RunFolder::names() const
{
    std::vector<std::string> names = contents_.pieces;
    names.insert(names.end(), contents_.results.begin(), contents_.results.end());
    names.insert(names.end(), contents_.numbered.begin(), contents_.numbered.end());
    return names;
}

// removes what an earlier run left: only names that runs make
Status RunFolder::start()
{
    std::error_code ignored;
    for (const auto* names : {&contents_.pieces, &contents_.results})
        for (const std::string& name : *names)
            fs::remove_all(path_ / name, ignored);
    for (const std::string& name : contents_.numbered)
        remove_numbered(path_ / name);
    fs::remove(path_ / "journal.jsonl", ignored);
    fs::remove(path_ / "run.json", ignored);
    return write_file_atomically(path_ / "run.json",
                                 Json{{"settings", settings_}, {"state", "running"}}.dump(1) + "\n");
}

// a line that is not whole (the process died while writing it) ends the journal; the file is cut there
Status RunFolder::read_journal()
{
    const Path path = path_ / "journal.jsonl";
    if (!fs::exists(path))
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
    if (at < text.size() && ::truncate(path.c_str(), off_t(at)) != 0)
        return system_failure("cut", path);
    return {};
}

Status RunFolder::append(const Json& entry)
{
    const std::string line = entry.dump() + "\n";
    size_t written = 0;
    while (written < line.size()) {
        const ssize_t n = ::write(journal_, line.data() + written, line.size() - written);
        if (n < 0 && errno != EINTR)
            return system_failure("write", path_ / "journal.jsonl");
        written += n > 0 ? size_t(n) : 0;
    }
    if (::fdatasync(journal_) != 0)
        return system_failure("write", path_ / "journal.jsonl");
    appended_ = true;
    return {};
}

void RunFolder::drop_if_empty()
{
    if (appended_ || !entries_.empty())
        return;
    std::error_code ignored;
    for (const char* name : {"run.json", "journal.jsonl", "lock"})
        fs::remove(path_ / name, ignored);
    for (const auto* names : {&contents_.pieces, &contents_.results})
        for (const std::string& name : *names)
            fs::remove(path_ / name, ignored); // a file, or a folder that is empty
    fs::remove(path_, ignored);                // stays if it holds anything else
}

Status RunFolder::finish(const Json& results)
{
    const Json summary{{"settings", settings_}, {"state", "finished"}, {"results", results}};
    SR_CHECK(write_file_atomically(path_ / "run.json", summary.dump(1) + "\n"));
    std::error_code ignored; // what stays only costs space
    for (const std::string& name : contents_.pieces)
        fs::remove_all(path_ / name, ignored);
    fs::remove(path_ / "lock", ignored);
    return {};
}

} // namespace semrover
