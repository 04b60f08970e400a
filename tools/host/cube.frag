#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

layout(location = 0) flat in vec4 cube;
layout(location = 0) out vec4 color;

void main() { color = cube; }
