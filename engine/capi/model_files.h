// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/capi/call.h"
#include "runtime/base/memory_files.h"

namespace semrover::capi {

// Where a model is: a path that the host gives, or files in its memory, which `folder` has then.
// Errors: usage for neither, and for files that MemoryFolder refuses. name: of the structure
Result<Path> model_path(const char* model, const sr_file* files, uint64_t count, const char* name,
                        std::unique_ptr<MemoryFolder>& folder);

} // namespace semrover::capi
