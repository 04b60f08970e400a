# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0

# libFuzzer, a library of Clang's, drives what GCC has compiled: which blocks of code run and what they compare is told by
# calls that GCC adds to all code. So one build with sanitizers serves tests and tests/fuzz. Programs that are not fuzzed
# have a call that does nothing.
file(GLOB LIBFUZZER /usr/lib/llvm-*/lib/clang/*/lib/*/libclang_rt.fuzzer*${CMAKE_SYSTEM_PROCESSOR}.a)
list(FILTER LIBFUZZER EXCLUDE REGEX "no_main|interceptors")
if(LIBFUZZER)
    list(GET LIBFUZZER -1 LIBFUZZER)
    add_library(no_coverage STATIC tests/fuzz/no_coverage.c)
    add_compile_options(-fsanitize-coverage=trace-pc,trace-cmp)
    link_libraries($<BUILD_INTERFACE:no_coverage>)
else()
    message(STATUS "Nothing to fuzz with: libFuzzer is not installed (tools/setup --test)")
endif()
