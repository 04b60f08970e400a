// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/faults/failing_memory.h"

#include <array>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <execinfo.h>
#include <link.h>
#include <new>
#include <string_view>

namespace {

// where the code of a shared library lies
struct Library {
    std::string_view name;
    uintptr_t begin = 0, end = 0;

    bool holds(const void* address) const { return uintptr_t(address) - begin < end - begin; }
};
Library library{"libsemrover.so"};
std::array<Library, 3> helpers = {Library{"libstdc++.so"}, {"libfmt.so"}, {"libxxhash.so"}};

int find_code(dl_phdr_info* info, size_t, void*)
{
    const auto find = [&](Library& one) {
        if (std::string_view(info->dlpi_name).find(one.name) == std::string_view::npos)
            return;
        for (int i = 0; i < info->dlpi_phnum; ++i)
            if (const auto& part = info->dlpi_phdr[i]; part.p_type == PT_LOAD && part.p_flags & PF_X) {
                one.begin = info->dlpi_addr + part.p_vaddr;
                one.end = one.begin + part.p_memsz;
            }
    };
    find(library);
    for (Library& one : helpers)
        find(one);
    return 0;
}

bool is_helper(const void* address)
{
    for (const Library& one : helpers)
        if (one.holds(address))
            return true;
    return false;
}

// the first caller that is no helper decides: LLVM, in the driver, is of C++, too
bool is_for_the_library(const void* caller)
{
    if (!is_helper(caller))
        return library.holds(caller);
    void* frames[24];
    const int count = backtrace(frames, 24);
    int i = 0;
    while (i < count && !is_helper(frames[i])) // this file's
        ++i;
    while (i < count && is_helper(frames[i]))
        ++i;
    return i < count && library.holds(frames[i]);
}

std::atomic<unsigned long> taken = 0, failing = 0;
std::atomic<long> alive = 0;
std::atomic<bool> lasting = false, failed = false;
thread_local bool asking = false; // backtrace() allocates at its first call

bool counts(const void* caller)
{
    if (!library.end || asking)
        return false;
    asking = true;
    const bool yes = is_for_the_library(caller);
    asking = false;
    return yes;
}

// of an allocation that counts
bool fails()
{
    if (!failing)
        return false;
    const unsigned long n = ++taken;
    if (lasting ? n < failing : n != failing)
        return false;
    failed = true;
    return true;
}

// before what operator new gives
struct alignas(__STDCPP_DEFAULT_NEW_ALIGNMENT__) Head {
    bool counted;
};

void* allocate(size_t bytes, const void* caller)
{
    const bool counted = counts(caller);
    if (counted && fails())
        return nullptr;
    auto* head = static_cast<Head*>(std::malloc(sizeof(Head) + bytes));
    if (!head)
        return nullptr;
    head->counted = counted;
    alive += counted;
    return head + 1;
}

void release(void* memory)
{
    if (!memory)
        return;
    Head* head = static_cast<Head*>(memory) - 1;
    alive -= head->counted;
    std::free(head);
}

void* or_throw(void* made)
{
    if (!made)
        throw std::bad_alloc();
    return made;
}

} // namespace

void memory_fails_at(unsigned long n, int all_after)
{
    failing = 0;
    dl_iterate_phdr(find_code, nullptr);
    taken = 0;
    failed = false;
    lasting = all_after != 0;
    failing = n;
}

unsigned long memory_taken(void)
{
    return taken;
}

int memory_failed(void)
{
    return failed;
}

long memory_alive(void)
{
    return alive;
}

#define CALLER __builtin_return_address(0)
void* operator new(size_t bytes)
{
    return or_throw(allocate(bytes, CALLER));
}
void* operator new(size_t bytes, const std::nothrow_t&) noexcept
{
    return allocate(bytes, CALLER);
}
void operator delete(void* memory) noexcept
{
    release(memory);
}
void operator delete(void* memory, size_t) noexcept
{
    release(memory);
}

#ifndef __SANITIZE_ADDRESS__ // which has a malloc of its own
extern "C" void* __libc_malloc(size_t bytes);
extern "C" void* malloc(size_t bytes)
{
    return counts(CALLER) && fails() ? nullptr : __libc_malloc(bytes);
}
#endif
