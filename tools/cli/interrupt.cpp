// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/interrupt.h"

#include "runtime/base/result.h"
#include "runtime/base/unfinished.h"
#include "runtime/system/process.h"
#include "tools/cli/print_stderr.h"

#include <atomic>
#include <chrono>
#include <mutex>
#include <system_error>
#include <thread>

namespace semrover {

namespace {

enum class Speaker { nobody, program, watch };
std::atomic<Speaker> last_word = Speaker::nobody;

// whether the last word is this one's
bool claim(Speaker speaker)
{
    Speaker before = Speaker::nobody;
    return last_word.compare_exchange_strong(before, speaker) || before == speaker;
}

struct Message {
    std::mutex mutex;
    std::string text = "interrupted";
};

Message& message()
{
    static auto* one = new Message; // never destroyed: the thread below may read it while the process ends
    return *one;
}

[[noreturn]] void end_at_once()
{
    system::give_all_threads_our_priority();
    remove_unfinished();
    const std::lock_guard lock(message().mutex);
    if (system::standard_error_is_terminal())
        print_stderr("\n"); // a line of progress may be open
    print_stderr("semrover: error: {}\n", message().text);
    system::exit_at_once(static_cast<int>(ErrorCode::interrupted));
}

// for one request, then for another one or the end of the grace
void wait_for_requests()
{
    while (!system::wait_for_stop_request({})) {
    }
    (void)system::wait_for_stop_request(kGraceSeconds);
    if (claim(Speaker::watch))
        end_at_once();
}

} // namespace

void watch_interrupts()
{
    message();
    system::watch_stop_requests();
    try {
        std::thread(wait_for_requests).detach();
    } catch (const std::system_error&) { // no threads: a request is seen between two pieces of work
    }
}

bool interrupt_requested()
{
    return system::stop_requested();
}

void set_interrupt_message(std::string text)
{
    const std::lock_guard lock(message().mutex);
    message().text = std::move(text);
}

void claim_last_word()
{
    while (!claim(Speaker::program))
        std::this_thread::sleep_for(std::chrono::hours(1));
    if (interrupt_requested())
        system::give_all_threads_our_priority();
    system::release_stop_requests();
}

} // namespace semrover
