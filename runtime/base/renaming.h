// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace semrover {

// Renames a file or folder; 0, or errno. Over a network the answer may be lost, and the second try, which nobody sees,
// finds nothing to rename: what is at `to` then is known again by its number.
int rename_surely(const std::filesystem::path& from, const std::filesystem::path& to);

} // namespace semrover
