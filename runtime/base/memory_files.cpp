// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/memory_files.h"

#include "runtime/base/inner_path.h"
#include "runtime/base/quote.h"

#include <atomic>
#include <mutex>

namespace semrover {

namespace {

constexpr std::string_view kPrefix = "memory:";

// all files of all folders by their whole paths
struct AllFiles {
    std::mutex mutex;
    std::map<std::string, std::span<const std::byte>> files;
    uint64_t folders = 0;         // made so far
    std::atomic<size_t> disk = 0; // how many lie at folders of the disk
};
AllFiles& all_files()
{
    static AllFiles all;
    return all;
}

bool is_ours(const Path& path)
{
    return path.generic_string().starts_with(kPrefix);
}

// whatever way a path is written
std::string key_of(const Path& path)
{
    std::error_code ignored;
    const Path whole = is_ours(path) ? path : std::filesystem::absolute(path, ignored);
    std::string key = whole.lexically_normal().generic_string();
    if (key.ends_with('/'))
        key.pop_back();
    return key;
}

} // namespace

MemoryFolder::MemoryFolder()
{
    AllFiles& all = all_files();
    const std::lock_guard guard(all.mutex);
    path_ = std::string(kPrefix) + std::to_string(++all.folders);
    take_keys();
}

MemoryFolder::MemoryFolder(Path path) : path_(std::move(path))
{
    take_keys();
    ++all_files().disk;
}

void MemoryFolder::take_keys()
{
    const std::string key = key_of(path_);
    first_ = key + "/";
    end_ = key + "0"; // the character after '/'
}

MemoryFolder::~MemoryFolder()
{
    AllFiles& all = all_files();
    const std::lock_guard guard(all.mutex);
    all.files.erase(all.files.lower_bound(first_), all.files.lower_bound(end_));
    all.disk -= first_.starts_with(kPrefix) ? 0 : 1;
}

Status MemoryFolder::add(std::string_view path, std::span<const std::byte> bytes)
{
    const Path inner = Path(path).lexically_normal();
    if (!leads_inside(path) || !inner.has_filename() || inner == ".")
        return fail(ErrorCode::usage, "a file in memory has the path {}, expected one below its folder",
                    quote_path(path));
    AllFiles& all = all_files();
    const std::lock_guard guard(all.mutex);
    if (!all.files.emplace(key_of(path_ / inner), bytes).second)
        return fail(ErrorCode::usage, "two files in memory have the path {}", quote_path(path));
    return {};
}

std::optional<MemoryEntry> find_in_memory(const Path& path)
{
    AllFiles& all = all_files();
    if (!is_ours(path) && all.disk == 0)
        return std::nullopt;
    const std::string key = key_of(path);
    const std::lock_guard guard(all.mutex);
    if (const auto file = all.files.find(key); file != all.files.end())
        return MemoryEntry{false, file->second};
    const auto below = all.files.lower_bound(key + "/");
    if (below != all.files.end() && below->first.starts_with(key + "/"))
        return MemoryEntry{true};
    return std::nullopt;
}

std::vector<std::string> names_in_memory(const Path& folder)
{
    AllFiles& all = all_files();
    if (!is_ours(folder) && all.disk == 0)
        return {};
    const std::string key = key_of(folder) + "/";
    const std::lock_guard guard(all.mutex);
    std::vector<std::string> names;
    for (auto file = all.files.lower_bound(key); file != all.files.end() && file->first.starts_with(key); ++file)
        names.push_back(file->first.substr(key.size()));
    return names;
}

} // namespace semrover
