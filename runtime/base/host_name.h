// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace semrover {

// This machine among those that share a folder: at most 64 letters, digits, points and minus signs. SEMROVER_HOST
// overrides it, for tests that play several.
const std::string& host_name();

} // namespace semrover
