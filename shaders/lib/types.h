// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_SHADER_TYPES_H
#define SEMROVER_SHADER_TYPES_H

// push structs are compiled as GLSL and as C++: 32-bit scalars only
#ifdef __cplusplus
#include <cstdint>
using uint = uint32_t;
#endif

#endif
