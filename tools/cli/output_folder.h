// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"

namespace semrover {

// A folder of results that appears whole or not at all: filled under a temporary name beside it, then renamed. Where
// the folder exists already, what was written replaces what has the same name in it; other files stay.
class OutputFolder {
  public:
    // usage when it exists and may not be touched (replace); bad_input when it cannot be made
    static Result<OutputFolder> create(const Path& path, bool replace);

    OutputFolder(OutputFolder&& other) noexcept;
    OutputFolder& operator=(OutputFolder&&) = delete;
    ~OutputFolder(); // without commit(): removes what was written

    const Path& path() const { return temporary_; } // to write into
    Path operator/(std::string_view name) const { return temporary_ / name; }
    Status commit();

  private:
    OutputFolder() = default;
    Status replace(const Path& name) const;

    Path path_, temporary_; // no temporary: done
    std::unique_ptr<Unfinished> unfinished_;
};

} // namespace semrover
