// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace semrover {

// Ends the program within two seconds of Ctrl-C (SIGINT), SIGTERM or a closed console window, with exit code 130 and no
// file half-written. The first of them makes interrupt_requested() true: commands save what they have and return
// ErrorCode::interrupted. Whatever has not returned after kGraceSeconds, such as a driver that compiles a shader, is
// not waited for: a thread removes unfinished files (runtime/base/unfinished.h) and ends the process. A second one does
// that at once. Call once, before there are other threads.
constexpr double kGraceSeconds = 1.2;
void watch_interrupts();

// true once the user has pressed Ctrl-C (SIGINT) or the system asks to stop (SIGTERM): save and return
// ErrorCode::interrupted
bool interrupt_requested();

// the line of a command that is ended by the thread above; "interrupted" until one is set
void set_interrupt_message(std::string message);

// Before the program's last line and exit: from now on these have their usual effect. Does not return if the thread
// above is ending the process already.
void claim_last_word();

} // namespace semrover
