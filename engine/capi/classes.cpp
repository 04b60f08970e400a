// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// classes: names and colours
#include "engine/capi/call.h"
#include "engine/scene/palette.h"

using namespace semrover;
using namespace semrover::capi;

extern "C" {

const char* sr_class_name(uint32_t id)
{
    return id < kClassCount ? kPalette[id].name.data() : nullptr; // a literal, which ends with zero
}

sr_status sr_class_color(uint32_t id, uint8_t rgb[3])
{
    return guarded(nullptr, [&]() -> Status {
        if (!rgb)
            return fail(ErrorCode::usage, "sr_class_color: rgb is NULL");
        if (id >= kClassCount)
            return fail(ErrorCode::usage, "sr_class_color: there is no class {}", id);
        std::ranges::copy(kPalette[id].color, rgb);
        return {};
    });
}

} // extern "C"

static_assert(SR_CLASSES == kClassCount);
