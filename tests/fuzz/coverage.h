/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0 */
#ifndef SEMROVER_TESTS_FUZZ_COVERAGE_H
#define SEMROVER_TESTS_FUZZ_COVERAGE_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

void begin_coverage(void); /* once, before anything is fuzzed */
void begin_input(void);
size_t most_memory(void); /* bytes that were in use at once since the input began, beyond what was before */

#ifdef __cplusplus
}
#endif

#endif
