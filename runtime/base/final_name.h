// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"

namespace semrover {

Path folder_of(const Path& path); // that it lies in; "." where it names none

// Names that are new or changed in a folder survive a power cut.
Status flush_names(const Path& folder);

// usage where something is there that is not to be replaced; bad_input where that cannot be told
Status refuse_existing(const Path& path, bool replace);
// Whether a folder is there; false: nothing is. bad_input: something else is, or that cannot be told
Result<bool> has_folder(const Path& path);

// Gives what is whole and on the disk, a file or folder, its final name; the name is on the disk when this returns.
Status rename_whole(const Path& from, const Path& to);

} // namespace semrover
