// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/capi/handles.h"

namespace semrover::capi {

// Does what was posted for a world: labels that are ready, edits, foci. By the call that works. What is not done, after
// an error or an exception, is posted again, behind what came meanwhile.
Status take_posts(sr_world& world);

} // namespace semrover::capi
