// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/plan.h"

#include <map>
#include <string>
#include <string_view>

namespace semrover {

// Which tile passes ran fastest with, as programs have measured it on a device. All tiles of a pass give the same bits.
class TileChoices {
  public:
    // of passes that take alike: their shader, its constants but for the tile, the output, the bytes that they bind
    using Key = uint64_t;
    static Key key(const Pass& pass);

    std::optional<uint32_t> best(Key key) const;
    void set(Key key, uint32_t tile) { best_[key] = tile; }
    size_t size() const { return best_.size(); }

    std::string text() const;         // a line each
    void read(std::string_view text); // in addition to those that are there; leaves out what text() does not write

  private:
    std::map<Key, uint32_t> best_;
};

} // namespace semrover
