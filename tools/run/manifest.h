// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"

namespace semrover {

// What a published folder holds, and what made it: manifest.json in it. A folder without one is not published.
struct Manifest {
    struct File {
        std::string path; // from the folder on
        uint64_t bytes = 0;
        std::string xxh64 = {};
        bool operator==(const File&) const = default;
    };

    std::string task, key;                     // TaskKeys::key
    std::string attempt, host, device, driver; // which made it
    std::string begun = {};                    // UTC, ISO 8601
    double seconds = 0;
    bool adopted = false;    // it went on from another attempt
    std::vector<File> files; // sorted
};

// Errors: bad_input for what is not a manifest, with a path that leads out of the folder too
Result<Manifest> read_manifest(const Path& folder);
Status write_manifest(const Path& folder, const Manifest& manifest); // on the disk when it returns

// All files below a folder with their hashes, but the manifest, and the files and folders directly in it that `skip`
// names. bad_input: links, devices
Result<std::vector<Manifest::File>> list_contents(const Path& folder, std::span<const char* const> skip = {});
// What is there in place of what the manifest says, a line each; empty: all is as it was
std::vector<std::string> differences(const Path& folder, const Manifest& manifest);

} // namespace semrover
