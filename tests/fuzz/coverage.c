// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// What libFuzzer needs of code that GCC compiled: a counter for each block, and where it lies; and how much memory is
// in use. It is called all the time, and is not itself counted (CMakeLists.txt).
#include "tests/fuzz/coverage.h"

#include <stdint.h>

enum { COUNTERS = 1 << 18 };

extern char __executable_start;
void __sanitizer_cov_8bit_counters_init(uint8_t* begin, uint8_t* end);
void __sanitizer_cov_pcs_init(const uintptr_t* begin, const uintptr_t* end);
int __sanitizer_install_malloc_and_free_hooks(void (*taken)(const volatile void*, size_t),
                                              void (*given)(const volatile void*));
size_t __sanitizer_get_allocated_size(const volatile void*);
void __sanitizer_cov_trace_pc(void);

static uint8_t counters[COUNTERS];
static uintptr_t blocks[2 * COUNTERS]; // address and flags of each
static size_t in_use, most;

void __sanitizer_cov_trace_pc(void)
{
    const uintptr_t block = (uintptr_t)__builtin_return_address(0);
    const uint64_t place = block - (uintptr_t)&__executable_start; // the same in each process
    const size_t at = place * 0x9e3779b97f4a7c15u >> 46;
    blocks[2 * at] = block;
    counters[at] += counters[at] < 255;
}

static void taken(const volatile void* at, size_t size)
{
    (void)at;
    in_use += size;
    if (in_use > most)
        most = in_use;
}
static void given(const volatile void* at)
{
    const size_t size = at ? __sanitizer_get_allocated_size(at) : 0;
    in_use -= size < in_use ? size : in_use;
}

void begin_coverage(void)
{
    __sanitizer_cov_8bit_counters_init(counters, counters + COUNTERS);
    __sanitizer_cov_pcs_init(blocks, blocks + 2 * COUNTERS);
    __sanitizer_install_malloc_and_free_hooks(taken, given);
}

void begin_input(void)
{
    most = in_use = 0;
}

size_t most_memory(void)
{
    return most;
}
