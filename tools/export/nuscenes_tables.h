// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/export/export_files.h"

#include <set>

namespace semrover {

// The tables of nuScenes v1.0, an array of records each. Source: the page schema_nuscenes.md of
// https://github.com/nutonomy/nuscenes-devkit
class NuscenesTables {
  public:
    NuscenesTables(); // with what does not depend on drives: categories, attributes, visibilities

    // Adds a record under the token of its table and key, which it gets. The same key gives the same token.
    std::string add(const char* table, const std::string& key, nlohmann::ordered_json record);
    void add_once(const char* table, const std::string& key, const nlohmann::ordered_json& record); // the first time
    static std::string token(const char* table, const std::string& key); // 32 hexadecimal digits
    Status write(const Path& folder) const;                              // all 13, also those without a record

  private:
    std::map<std::string, nlohmann::ordered_json> tables_;
    std::set<std::string> once_;
};

const char* nuscenes_category(uint8_t label); // nullptr: there is none for it
// of a thing that moves now, at another time, or never
const char* nuscenes_attribute(uint8_t label, bool moves_now, bool moves);
const char* nuscenes_visibility(double shown); // token: 1 to 4

} // namespace semrover
