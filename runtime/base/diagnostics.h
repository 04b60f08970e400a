// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace semrover {

// Lines that no return value carries: what a validation layer says, that a file system has no locks, and a failed
// assertion before the process ends. Nothing here prints. A program that wants to see them sets a callback, for all
// threads and devices of the process; null (as it begins): they are dropped.
// Threads: any may call either; the callback runs on the thread that has something to say, one line at a time.
using DiagnosticCallback = void (*)(void* user, const char* line);
void set_diagnostic_callback(DiagnosticCallback callback, void* user = nullptr);

void diagnose(const std::string& line);

} // namespace semrover
