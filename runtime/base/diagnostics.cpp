// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/diagnostics.h"

#include <mutex>

namespace semrover {

namespace {

struct Listener {
    std::mutex mutex;
    DiagnosticCallback callback = nullptr;
    void* user = nullptr;
};

Listener& listener()
{
    static auto* one = new Listener; // never destroyed: a layer may speak while the process ends
    return *one;
}

} // namespace

void set_diagnostic_callback(DiagnosticCallback callback, void* user)
{
    Listener& l = listener();
    const std::lock_guard lock(l.mutex);
    l.callback = callback;
    l.user = user;
}

void diagnose(const std::string& line)
{
    Listener& l = listener();
    const std::lock_guard lock(l.mutex);
    if (l.callback)
        l.callback(l.user, line.c_str());
}

} // namespace semrover
