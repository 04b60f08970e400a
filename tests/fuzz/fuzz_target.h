// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/memory_files.h"
#include "runtime/base/result.h"

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace semrover::fuzz {

using Bytes = std::span<const std::byte>;

constexpr uint64_t kMebibyte = 1 << 20;

// A reader that libFuzzer calls with what it makes up. Memory is what SECURITY.md promises: at most `per_byte` times
// the input and `more`; more of it ends the process as a finding.
struct FuzzTarget {
    const char* name;
    const char* inputs; // patterns of names, with blanks between: which files of tests it begins with
    void (*run)(Bytes input);
    uint32_t most_bytes = 16 << 10; // of an input
    uint64_t per_byte = 2, more = 64 * kMebibyte;
};

// by what they read
std::span<const FuzzTarget> model_targets();
std::span<const FuzzTarget> scene_targets();
std::span<const FuzzTarget> mesh_targets();
std::span<const FuzzTarget> picture_targets();
std::span<const FuzzTarget> camera_targets();
std::span<const FuzzTarget> annotation_targets();
std::span<const FuzzTarget> folder_targets();
std::span<const FuzzTarget> run_targets();
std::span<const FuzzTarget> capi_targets();

// ends the process with a line: what is wrong is a finding
[[noreturn]] void found(std::string_view what);

// bad_input with one line that says something; anything else is a finding
void check_error(const Error& error);

template <typename T>
bool accepts(const Result<T>& result)
{
    if (!result)
        check_error(result.error());
    return result.has_value();
}

inline std::string_view text_of(Bytes bytes)
{
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// the input as a file of that name
class InputFile {
  public:
    InputFile(Bytes input, std::string_view name) : name_(name) { (void)folder_.add(name, input); }
    operator Path() const { return folder_.path() / name_; }

  private:
    MemoryFolder folder_;
    std::string name_;
};

// The input as a folder. Where a line begins with kFileMark, the rest of it is the name of a file that what follows
// belongs to. An input without such lines is a file `first`.
constexpr std::string_view kFileMark = "@@@ ";

class InputFolder {
  public:
    explicit InputFolder(Bytes input, std::string_view first = "file");
    const Path& path() const { return folder_.path(); }
    const std::vector<std::string>& names() const { return names_; }
    operator Path() const { return folder_.path(); }
    // of the first file
    Path first() const { return folder_.path() / names_.front(); }

  private:
    void add(std::string_view name, Bytes bytes);

    MemoryFolder folder_;
    std::vector<std::string> names_;
};

} // namespace semrover::fuzz
