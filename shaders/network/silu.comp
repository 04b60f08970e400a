#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = x / (1 + exp(-x))
#extension GL_GOOGLE_include_directive : require
#include "lib/activation.glsl"
#define FUNCTION silu
#include "lib/elementwise.glsl"
