// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/semrover.h"
#include "runtime/base/assertion.h"
#include "runtime/base/result.h"

#include <algorithm>
#include <cstring>
#include <new>

// what every call of the C interface does: copies structures within their sizes, turns errors and exceptions into
// statuses
namespace semrover::capi {

// where the line of a call that failed goes: into its context, or else into the thread
sr_status remember(sr_context* context, sr_status status, std::string message) noexcept;

// What a call uses of its context. Two calls that use the same part do not meet: those of a worker and those that draw
// may be at work at the same time, others alone, and those that lock for themselves at any time.
enum Use : uint32_t { kAnyTime = 0, kWork = 1, kDraw = 2, kAlone = 3 };

// a line where there may be no memory for it; then less, which a string holds without allocating
std::string line_of(const char* text) noexcept;

// A call's right to its context, if any. Not taken: another call uses that part, or this one is made by a callback of
// another one with the same context, on whichever part.
class Turn {
  public:
    Turn(sr_context* context, Use use) noexcept;
    ~Turn();
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;

    bool taken() const { return taken_; }
    static sr_status refuse() noexcept; // leaves the line with the thread: the context's is being written

  private:
    sr_context* context_;
    Use use_;
    bool taken_ = false;
    const Turn* outer_ = nullptr; // of this thread
};

// destroys a handle of a context, or does nothing where another call is at work
template <typename T>
void destroy(T* handle) noexcept
{
    if (!handle)
        return;
    if (const Turn turn(handle->context, kAlone); turn.taken())
        delete handle;
    else
        Turn::refuse();
}

// calls f, which returns Status; nothing it throws gets past
template <Use use = kAlone, typename F>
sr_status guarded(sr_context* context, F f) noexcept
{
    const Turn turn(context, use);
    if (!turn.taken())
        return Turn::refuse();
    try {
        const AssertionsThrow assertions;
        if (Status status = f(); !status)
            return remember(context, sr_status(status.error().code), std::move(status.error().message));
        return SR_OK;
    } catch (const std::bad_alloc&) {
        return remember(context, SR_ERR_OUT_OF_MEMORY, kNoHostMemory);
    } catch (const std::exception& error) {
        return remember(context, SR_ERR_INTERNAL, line_of(error.what()));
    } catch (...) {
        return remember(context, SR_ERR_INTERNAL, "internal");
    }
}

// the caller's structure as this library knows it
template <typename T>
Result<T> read_struct(const T* given, const char* name)
{
    T known{};
    if (!given || given->struct_size < sizeof(uint32_t))
        return fail(ErrorCode::usage, "{}: {}", name, given ? "struct_size is not set" : "NULL");
    const auto* bytes = reinterpret_cast<const unsigned char*>(given);
    std::memcpy(&known, bytes, std::min<size_t>(given->struct_size, sizeof(T)));
    for (size_t i = sizeof(T); i < given->struct_size; ++i)
        if (bytes[i])
            return fail(ErrorCode::usage, "{}: byte {} asks for something that version {} does not know", name, i,
                        SEMROVER_VERSION);
    if constexpr (requires { known.next; })
        if (known.next)
            return fail(ErrorCode::usage, "{}: next is not NULL", name);
    return known;
}

// A number of the application's, low..high. Errors: usage for another one, and for what is none. name: of the structure
template <typename To = double>
Result<To> number_in(double value, double low, double high, const char* name, const char* field)
{
    if (!(value >= low && value <= high))
        return fail(ErrorCode::usage, "{}: {} is {}, expected {} to {}", name, field, value, low, high);
    return To(value);
}

// `size` bytes of the caller's, of which the first four stay
template <typename T>
void write_struct(const T& known, void* to, uint32_t size)
{
    const size_t count = std::min<size_t>(size, sizeof(T));
    std::memcpy(static_cast<char*>(to) + 4, reinterpret_cast<const char*>(&known) + 4, count > 4 ? count - 4 : 0);
}

// as much as there is room for, and zeros
template <size_t N>
void copy_text(char (&to)[N], const std::string& text)
{
    const size_t count = std::min(text.size(), N - 1);
    std::memcpy(to, text.data(), count);
    std::memset(to + count, 0, N - count);
}

// the caller's structure for a result. name: of the call
template <typename T>
Status write_result(const T& known, T* to, const char* name)
{
    if (!to || to->struct_size < 8)
        return fail(ErrorCode::usage, "{}: {}", name, to ? "struct_size is not set" : "NULL");
    write_struct(known, to, to->struct_size);
    return {};
}

} // namespace semrover::capi
