// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace semrover {

// XXH64 of a sequence of pieces, to recognise files and settings; not a defence against forgery
class Hash {
  public:
    Hash();
    ~Hash();
    Hash(const Hash&) = delete;
    Hash& operator=(const Hash&) = delete;

    // hashes the length, too, so that ("ab", "c") and ("a", "bc") differ
    void add(std::span<const std::byte> bytes);
    void add(std::string_view text) { add(std::as_bytes(std::span(text.data(), text.size()))); }
    Status add_file(const Path& path); // its bytes, as add() would
    uint64_t value() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

Result<uint64_t> hash_file(const Path& path);     // of its bytes, as one piece
Result<uint64_t> hash_folder(const Path& folder); // of the names and bytes of its files; folders in it do not count

std::string hash_text(uint64_t hash); // 16 hexadecimal digits

} // namespace semrover
