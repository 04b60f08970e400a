// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/npy.h"
#include "runtime/base/file.h"

#include <map>
#include <memory>
#include <string>

namespace semrover {

constexpr uint64_t kMaxNpzArrayBytes = uint64_t(1) << 32;

// numpy's .npz: a zip of .npy files, stored or deflated. Untrusted input: only arrays that are asked for are inflated,
// a piece at a time into what has arrived, never beyond what their header says; entries whose declared or real size is
// another are refused, as are encrypted ones, more than 1024 entries, and zip's other compressions where the library
// has them not.
class NpzFile {
  public:
    static Result<NpzFile> open(const Path& path);
    NpzFile(NpzFile&&) noexcept;
    ~NpzFile();

    bool has(std::string_view array) const;
    std::vector<std::string> names() const; // of the arrays, sorted

    Result<NpyHeader> header(std::string_view array) const;
    // bad_input when it is missing, or has more than `max_bytes` of data
    Result<NpyArray> read(std::string_view array, uint64_t max_bytes = kMaxNpzArrayBytes) const;
    Result<double> number(std::string_view array) const; // bad_input for anything but one float

  private:
    struct Archive;
    explicit NpzFile(std::unique_ptr<Archive> archive);

    std::unique_ptr<Archive> archive_;
};

// stored without compression, entries in the order of their names, dated 1980: the same arrays give the same bytes.
// Atomic.
Status write_npz(const Path& path, const std::map<std::string, NpyArray>& arrays);

// The numbers of an array of any type, as T (uint8_t, int32_t or uint32_t): integers, booleans, and floats that are
// whole. bad_input, with `where` in front, for a number that T cannot hold.
template <typename T>
Result<std::vector<T>> whole_numbers(const NpyArray& array, std::string_view where);

} // namespace semrover
