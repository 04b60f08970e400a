#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = max(x, 0)
#extension GL_GOOGLE_include_directive : require
#define FUNCTION(v) max(v, 0.0)
#include "lib/elementwise.glsl"
