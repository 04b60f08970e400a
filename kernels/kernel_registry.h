// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/kernel.h"

namespace semrover {

// every kernel that was built, by name; the list is written by cmake/shaders.cmake from the files in shaders/
std::span<const Kernel* const> kernel_registry();

} // namespace semrover
