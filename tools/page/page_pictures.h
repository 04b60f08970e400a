// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"
#include "runtime/base/result.h"

#include <functional>
#include <string>
#include <vector>

namespace semrover {

// a folder of pictures NNNNNN.png (or .jpg), one a moment, as `render`, `refine` and `streets` write them
struct PictureSet {
    std::string name;
    Path folder;
};

struct PictureOptions {
    uint32_t limit = 48; // moments, evenly chosen, first and last among them
    int quality = 85;    // of JPEG
};

struct Picture {
    std::string type; // of media: image/png, image/jpeg
    std::vector<std::byte> file;
};

// several sets of pictures of the same moments
struct PictureTable {
    std::vector<std::string> names;                   // [S]
    std::vector<std::pair<uint32_t, uint32_t>> sizes; // [S] width, height
    std::vector<uint32_t> moments;                    // [M] numbers of the files
    std::vector<std::vector<Picture>> pictures;       // [S][M]
    uint64_t shared = 0;                              // moments that all sets have
    std::vector<std::string> warnings;                // a line each
};

// Pictures are encoded anew: as JPEG, or as PNG where that is hardly larger or the picture is drawn in few
// colours (labels), so that nothing of the files but
// their pixels gets in. Moments that a set lacks are left out, with a warning. bad_input: no pictures, two of one
// number, no moment that all sets have, another size within a set, another shape than the first set's.
// `done` hears how many pictures there are after each one and may stop.
Result<PictureTable> read_pictures(const std::vector<PictureSet>& sets, const PictureOptions& options,
                                   const std::function<Status(uint64_t done, uint64_t total)>& done);

} // namespace semrover
