#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// clock.row += 1, at the end of a step, so that the same commands do the next one
#extension GL_GOOGLE_include_directive : require
#include "lib/step_row.h"

layout(local_size_x = 1) in;
layout(binding = 0) buffer Clock { StepClock clock; };

void main() { clock.row += 1; }
