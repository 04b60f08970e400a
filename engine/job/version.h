// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace semrover {

// CMake's project version; what --version says and what run folders and grids record
inline constexpr char kVersion[] = SEMROVER_VERSION;
inline constexpr char kProgram[] = "semrover " SEMROVER_VERSION;

} // namespace semrover
