/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0 */
/* Preloaded, it keeps the libraries of KEEP_LOADED (names with colons between them) loaded until the process ends. So
 * LeakSanitizer can say from which of them an allocation came. */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

__attribute__((constructor)) static void keep(void)
{
    const char* names = getenv("KEEP_LOADED");
    char one[256];
    for (; names && *names; names += strspn(names, ":")) {
        const size_t length = strcspn(names, ":");
        snprintf(one, sizeof one, "%.*s", (int)length, names);
        if (!dlopen(one, RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE))
            fprintf(stderr, "keep_loaded: %s\n", dlerror());
        names += length;
    }
}
