# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0

# each file of assets/label_maps -> <build>/generated/label_maps.h: the tables that --map NAME knows, without files
file(GLOB label_maps CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/assets/label_maps/*.json)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${label_maps})
set(label_map_entries)
foreach(file ${label_maps})
    cmake_path(GET file STEM name)
    file(READ ${file} text)
    string(APPEND label_map_entries "    {\"${name}\", R\"json~(${text})json~\"},\n")
endforeach()
file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/generated/label_maps.h @ONLY CONTENT
"// made by cmake/label_maps.cmake
#pragma once

#include <string_view>

namespace semrover {

struct LabelMapAsset {
    std::string_view name, json;
};

// sorted by name
inline constexpr LabelMapAsset kLabelMapAssets[] = {
@label_map_entries@};

} // namespace semrover
")
set_source_files_properties(engine/format/label_table.cpp PROPERTIES INCLUDE_DIRECTORIES ${CMAKE_BINARY_DIR}/generated)
