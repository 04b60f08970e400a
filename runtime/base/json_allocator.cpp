// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/json_allocator.h"

#include <mutex>
#include <new>

namespace {

// pieces lie one behind the other, and are free together
struct Reserve {
    static constexpr size_t kValues = 65536;

    std::mutex mutex;
    size_t used = 0, pieces = 0;
    alignas(nlohmann::json) std::byte bytes[kValues * sizeof(nlohmann::json)];

    void* take(size_t size)
    {
        const std::lock_guard lock(mutex);
        if (size > sizeof bytes - used)
            throw std::bad_alloc();
        ++pieces;
        return bytes + std::exchange(used, used + size);
    }

    bool holds(const void* piece) const { return piece >= bytes && piece < bytes + sizeof bytes; }

    void give_back()
    {
        const std::lock_guard lock(mutex);
        if (--pieces == 0)
            used = 0;
    }
};
Reserve reserve{};

} // namespace

nlohmann::json* std::allocator<nlohmann::json>::allocate(size_t count)
{
    if (count > SIZE_MAX / 2 / sizeof(nlohmann::json))
        throw std::bad_array_new_length();
    const size_t size = count * sizeof(nlohmann::json);
    void* values = ::operator new(size, std::nothrow);
    return static_cast<nlohmann::json*>(values ? values : reserve.take(size));
}

void std::allocator<nlohmann::json>::deallocate(nlohmann::json* values, size_t count) noexcept
{
    if (reserve.holds(values))
        reserve.give_back();
    else
        ::operator delete(values, count * sizeof(nlohmann::json));
}
