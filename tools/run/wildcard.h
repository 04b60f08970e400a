// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"

namespace semrover {

// As fnmatch() of POSIX with no flag: * any text, ? any byte, [a-z] and [!a-z] one of these, \ before one that is
// meant.
bool matches(std::string_view pattern, std::string_view text);

// Paths that are there, sorted, as glob() of POSIX finds them: each part of the pattern stands for names in one folder,
// and names that begin with a dot are found by such a pattern only. What there is no permission to look at is left out.
// bad_input: a folder cannot be listed
Result<std::vector<Path>> paths_like(const Path& pattern);

} // namespace semrover
