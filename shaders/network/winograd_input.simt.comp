#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// V = B^T d B per tile of 6 x 6 pixels and channel, four channels a thread; zeros outside the image
// note: two at a time, as 36 samples of four are more registers than RDNA 3 has for a thread
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#define CHANNELS vec2
#define PARTS 2
#define PART(value, part) mix(value.zw, value.xy, bvec2(part == 0))
#include "lib/winograd_input.glsl"
