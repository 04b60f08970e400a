// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace semrover {

// This machine among those that share a folder, for names of files: 1 to 64 of [A-Za-z0-9_-]. SEMROVER_HOST overrides
// it, for tests that play several.
const std::string& host_name();

} // namespace semrover
