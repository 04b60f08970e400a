// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the C headers alone, in C++
#include "engine/semrover_gl.h"
#include "engine/semrover_vulkan.h"

#include <type_traits>

static_assert(std::is_standard_layout_v<sr_world_desc> && std::is_trivial_v<sr_draw_desc>);
static_assert(std::is_trivial_v<sr_gl_draw_desc> && std::is_trivial_v<sr_renderer_desc>);
static_assert(std::is_same_v<decltype(&sr_world_create), sr_status (*)(sr_context*, const sr_world_desc*, sr_world**)>);
