// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"

#include "tools/cli/commands.h"

namespace semrover {

// a model in the diffusers layout, from a single-file LDM checkpoint or from another folder, with weights of another
// precision or with a deferred renderer's input channels: asd_init for one of images, vsd_init for one of videos
struct ConvertModelOptions {
    std::string in, out, dtype;
    bool asd_init = false, vsd_init = false, dry_run = false;
};
// whether a file or folder has weights of a network, or says that it does
bool is_model(const Path& path);

Status convert_model(const ConvertModelOptions& options, const Globals& globals);

} // namespace semrover
