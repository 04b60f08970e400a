// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/label_column.h"

#include <algorithm>

namespace semrover {

namespace {

// CloudCompare writes scalar_ in front of a name; classification is what LAS calls it, semantic what KITTI-360 does,
// ObjTag what CARLA's semantic lidar does
constexpr LabelColumn kColumns[] = {
    {"label", ""},
    {"class", ""},
    {"semantic", "kitti360"},
    {"semantic_label", ""},
    {"class_id", ""},
    {"classification", "asprs"},
    {"Classification", "asprs"},
    {"category", ""},
    {"category_id", ""},
    {"objtag", "carla"},
    {"ObjTag", "carla"},
    {"scalar_label", ""},
    {"scalar_Label", ""},
    {"scalar_class", ""},
    {"scalar_semantic", "kitti360"},
    {"scalar_Classification", "asprs"},
    {"scalar_classification", "asprs"},
};

} // namespace

std::span<const LabelColumn> label_columns()
{
    return kColumns;
}

bool says_own_labels(const std::vector<std::string>& comments)
{
    return std::ranges::find(comments, kOwnLabelsComment) != comments.end();
}

} // namespace semrover
