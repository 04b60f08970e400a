// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// What GCC calls where a block of code begins, in programs that are not fuzzed; and where it compares floats, which
// neither the sanitizers nor libFuzzer look at.
#define HIDDEN __attribute__((visibility("hidden")))

HIDDEN void __sanitizer_cov_trace_pc(void);
HIDDEN void __sanitizer_cov_trace_cmpf(float a, float b);
HIDDEN void __sanitizer_cov_trace_cmpd(double a, double b);

void __sanitizer_cov_trace_pc(void) {}

void __sanitizer_cov_trace_cmpf(float a, float b)
{
    (void)a;
    (void)b;
}

void __sanitizer_cov_trace_cmpd(double a, double b)
{
    (void)a;
    (void)b;
}
