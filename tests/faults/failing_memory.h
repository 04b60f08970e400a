/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Host memory of the library that is short: operator new and malloc of a program, which libsemrover.so, and for it the
 * C++ library, fmt and xxHash, call. What others allocate, the driver and the host among them, is always there. */
#ifndef SEMROVER_TESTS_FAULTS_FAILING_MEMORY_H
#define SEMROVER_TESTS_FAULTS_FAILING_MEMORY_H

#ifdef __cplusplus
extern "C" {
#endif

/* the n-th allocation of the library from now on fails, with all after it where `lasting`. 0: none does */
void memory_fails_at(unsigned long n, int lasting);
/* allocations since then */
unsigned long memory_taken(void);
/* whether one has failed */
int memory_failed(void);
/* what the library has of operator new, in numbers of allocations */
long memory_alive(void);

#ifdef __cplusplus
}
#endif
#endif
