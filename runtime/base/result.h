// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>
#include <new>
#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace semrover {

// what went wrong in the world (a file, a device, memory); values are the program's exit codes
enum class ErrorCode : int {
    verify_failed = 1, // a check that was asked for found a difference
    usage = 2,
    bad_input = 3,
    no_device = 4,
    out_of_memory = 5,
    device_lost = 6,
    partial = 7,
    internal = 70,
    busy = 75, // another process has it, or it cannot be seen yet: try again
    interrupted = 130,
};

inline constexpr char kNoHostMemory[] = "no host memory"; // short: a string holds it without allocating

struct Error {
    ErrorCode code = ErrorCode::internal;
    std::string message; // one line: what, where, expected and found, what to do
};

template <typename T>
using Result = tl::expected<T, Error>;
using Status = tl::expected<void, Error>;

template <typename... Args>
[[nodiscard]] tl::unexpected<Error> fail(ErrorCode code, fmt::format_string<Args...> format, Args&&... args)
{
    return tl::make_unexpected(Error{code, fmt::format(format, std::forward<Args>(args)...)});
}

// f(), which returns a Status or a Result; out_of_memory where it throws std::bad_alloc. For threads, which an
// exception that leaves them ends with the process, and destructors.
template <typename F>
auto unless_memory_is_short(const F& f) -> decltype(f())
{
    try {
        return f();
    } catch (const std::bad_alloc&) {
        return tl::make_unexpected(Error{ErrorCode::out_of_memory, kNoHostMemory});
    }
}

// stops the program: a caller's bug, never a bad file or device
[[noreturn]] void assertion_failed(const char* condition, const char* file, int line, const std::string& message);

} // namespace semrover

#define SR_CONCAT_(a, b) a##b
#define SR_CONCAT(a, b) SR_CONCAT_(a, b)

// SR_TRY(auto x, f()): declares x as the value of f(), or returns f's error
#define SR_TRY(declaration, expression)                                                                                \
    auto SR_CONCAT(sr_result_, __LINE__) = (expression);                                                               \
    if (!SR_CONCAT(sr_result_, __LINE__))                                                                              \
        return tl::make_unexpected(std::move(SR_CONCAT(sr_result_, __LINE__)).error());                                \
    declaration = std::move(*SR_CONCAT(sr_result_, __LINE__))

// SR_CHECK(f()): returns f's error, if any
#define SR_CHECK(expression)                                                                                           \
    do {                                                                                                               \
        if (auto sr_status = (expression); !sr_status)                                                                 \
            return tl::make_unexpected(std::move(sr_status).error());                                                  \
    } while (0)

#define SR_ASSERT(condition, ...)                                                                                      \
    do {                                                                                                               \
        if (!(condition))                                                                                              \
            ::semrover::assertion_failed(#condition, __FILE__, __LINE__, fmt::format(__VA_ARGS__));                    \
    } while (0)
