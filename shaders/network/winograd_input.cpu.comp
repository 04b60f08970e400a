#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// V = B^T d B per tile of 6 x 6 pixels and channel, four channels a thread; zeros outside the image
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#define CHANNELS vec4
#define PARTS 1
#define PART(value, part) value
#include "lib/winograd_input.glsl"
