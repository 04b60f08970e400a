#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = 0.5 x (1 + tanh(sqrt(2/pi) (x + 0.044715 x^3)))
#extension GL_GOOGLE_include_directive : require
#include "lib/activation.glsl"
#define FUNCTION gelu_tanh
#include "lib/elementwise.glsl"
