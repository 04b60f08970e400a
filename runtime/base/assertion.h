// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>

namespace semrover {

// what a failed assertion throws within AssertionsThrow; what() is its line
class AssertionFailed : public std::logic_error {
  public:
    using std::logic_error::logic_error;
};

// While one lives, failed assertions of its thread throw, instead of ending the process: for calls from programs that
// are not ours. note: one that fails in a destructor ends the process all the same.
class AssertionsThrow {
  public:
    AssertionsThrow();
    ~AssertionsThrow();
    AssertionsThrow(const AssertionsThrow&) = delete;
    AssertionsThrow& operator=(const AssertionsThrow&) = delete;

  private:
    bool before_;
};

} // namespace semrover
