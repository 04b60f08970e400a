// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"

namespace semrover {

// A model's model_index.json: {COMPONENT: [LIBRARY, CLASS], "defaults", "presets"}. Without the file an object with
// nothing in it. bad_input: no object
Result<Json> read_model_index(const Path& folder);

} // namespace semrover
