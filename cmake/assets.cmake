# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0

# embed_assets(FOLDER STRUCT ARRAY SOURCE): each file of assets/FOLDER -> <build>/generated/FOLDER_json.h, an array of names
# and texts, sorted by name, which SOURCE knows without files
function(embed_assets folder struct array source)
    file(GLOB files CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/assets/${folder}/*.json)
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${files})
    set(entries)
    foreach(file ${files})
        cmake_path(GET file STEM name)
        file(READ ${file} text)
        string(APPEND entries "    {\"${name}\", R\"json~(${text})json~\"},\n")
    endforeach()
    file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/generated/${folder}_json.h @ONLY CONTENT
"// made by cmake/assets.cmake
#pragma once

#include <string_view>

namespace semrover {

struct @struct@ {
    std::string_view name, json;
};

inline constexpr @struct@ @array@[] = {
@entries@};

} // namespace semrover
")
    set_source_files_properties(${source} PROPERTIES INCLUDE_DIRECTORIES ${CMAKE_BINARY_DIR}/generated)
endfunction()

# the tables that --map NAME knows
embed_assets(label_maps LabelMapAsset kLabelMapAssets engine/format/label_table.cpp)
# the sensors that "lidar" of a rig knows
embed_assets(lidar LidarAsset kLidarAssets engine/camera/lidar.cpp)
