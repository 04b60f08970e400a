// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the classes of labels
#include "engine/capi/call.h"
#include "engine/scene/palette.h"

using namespace semrover;
using namespace semrover::capi;

extern "C" {

const char* sr_label_name(uint32_t label)
{
    return label < kClassCount ? kPalette[label].name.data() : nullptr; // a literal, which ends with zero
}

sr_status sr_label_color(uint32_t label, uint8_t rgb[3])
{
    return guarded(nullptr, [&]() -> Status {
        if (!rgb)
            return fail(ErrorCode::usage, "sr_label_color: rgb is NULL");
        if (label >= kClassCount)
            return fail(ErrorCode::usage, "sr_label_color: there is no label {}", label);
        std::ranges::copy(kPalette[label].color, rgb);
        return {};
    });
}

} // extern "C"

static_assert(SR_LABELS == kClassCount);
