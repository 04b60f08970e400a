// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/run/wildcard.h"

#include "runtime/base/quote.h"
#include "runtime/base/star_pattern.h"

#include <algorithm>
#include <optional>

namespace semrover {

namespace {

namespace fs = std::filesystem;

// Takes one set, such as [a-cx], off the pattern behind its bracket: whether `c` is in it. None: no bracket ends it
std::optional<bool> take_set(std::string_view& pattern, char c)
{
    std::string_view rest = pattern;
    const bool others = rest.starts_with('!') || rest.starts_with('^');
    rest.remove_prefix(others);
    bool found = false;
    for (bool first = true; !rest.empty() && (first || rest[0] != ']'); first = false) {
        const char low = rest[0];
        const bool range = rest.size() > 2 && rest[1] == '-' && rest[2] != ']';
        const char high = range ? rest[2] : low;
        found |= low <= c && c <= high;
        rest.remove_prefix(range ? 3 : 1);
    }
    if (rest.empty())
        return std::nullopt;
    pattern = rest.substr(1);
    return found != others;
}

// takes what stands for one byte off the pattern: whether it stands for this one
bool take_one(std::string_view& pattern, char c)
{
    char wanted = pattern[0];
    pattern.remove_prefix(1);
    if (wanted == '?')
        return true;
    if (wanted == '[')
        if (const auto in_set = take_set(pattern, c))
            return *in_set;
    if (wanted == '\\' && !pattern.empty()) {
        wanted = pattern[0];
        pattern.remove_prefix(1);
    }
    return wanted == c;
}

} // namespace

bool matches(std::string_view pattern, std::string_view text)
{
    return matches_stars(pattern, text, take_one);
}

Result<std::vector<Path>> paths_like(const Path& pattern)
{
    constexpr auto kDenied = fs::directory_options::skip_permission_denied;
    std::vector<Path> found{pattern.root_path()};
    std::error_code error;
    for (const Path& part : pattern.relative_path()) {
        const std::string name = part.string();
        std::vector<Path> next;
        for (const Path& folder : found) {
            if (name.find_first_of("*?[\\") == name.npos) {
                if (fs::exists(folder / part, error))
                    next.push_back(folder / part);
                if (error && error != std::errc::permission_denied)
                    return fail(ErrorCode::bad_input, "cannot examine {}: {}", quote_path(folder / part),
                                error.message());
                continue;
            }
            if (!folder.empty() && !is_folder(folder))
                continue;
            for (fs::directory_iterator i(folder.empty() ? "." : folder, kDenied, error), end; !error && i != end;
                 i.increment(error)) {
                const Path file = i->path().filename();
                if (matches(name, file.string()) && (name[0] == '.' || file.string()[0] != '.'))
                    next.push_back(folder / file);
            }
            if (error)
                return fail(ErrorCode::bad_input, "cannot list {}: {}", quote_path(folder), error.message());
        }
        found = std::move(next);
    }
    std::ranges::sort(found, {}, [](const Path& path) { return path.string(); });
    return found;
}

} // namespace semrover
