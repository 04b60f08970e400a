// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/capi/model_files.h"

namespace semrover::capi {

Result<Path> model_path(const char* model, const sr_file* files, uint64_t count, const char* name,
                        std::unique_ptr<MemoryFolder>& folder)
{
    if (!files != !count)
        return fail(ErrorCode::usage, "{}: model_files and their count come together", name);
    if (!files && !model)
        return fail(ErrorCode::usage, "{}: model is NULL", name);
    if (!files)
        return Path(model);
    folder = std::make_unique<MemoryFolder>();
    for (uint64_t i = 0; i < count; ++i) {
        const sr_file& file = files[i];
        if (!file.path || (!file.data && file.bytes))
            return fail(ErrorCode::usage, "{}: file {} of {} has no path or no data", name, i, count);
        SR_CHECK(folder->add(file.path, {static_cast<const std::byte*>(file.data), size_t(file.bytes)}));
    }
    return model ? folder->path() / model : folder->path();
}

} // namespace semrover::capi
