// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/conditioning/cell_objects.h"
#include "engine/model/transformer_config.h"

namespace semrover {

// the numbers of one entry of a model's condition, its flag first (docs/method.md §2.1)
void object_condition(const SceneObject& object, const std::array<double, 3>& point, std::span<float> out); // 60
void tint_condition(const std::array<double, 3>& tint, std::span<float> out);                               // 4
void part_condition(const SceneObject& part, const std::array<double, 3>& point, std::span<float> out);     // 64

// What a model is conditioned on beside the labels of a grid's voxels, from the objects that are known.
class VoxelConditions {
  public:
    VoxelConditions() = default; // unconditioned

    // of the grid's voxels as they are now, in their order. Errors: as objects_of_cells
    static Result<VoxelConditions> create(const TransformerConfig& config, const VoxelGrid& grid,
                                          std::span<const SceneObject> objects);

    bool empty() const { return owners_.empty(); }
    size_t width() const { return width_; }
    // of one voxel; zeros where nothing is known. out: width() numbers
    void row(uint32_t cell, const Cell& index, std::span<float> out) const;

  private:
    const SceneObject* of_cell(std::span<const int32_t> owners, uint32_t cell) const; // NULL: none

    std::vector<ConditionPart> parts_;
    size_t width_ = 0;
    double voxel_size_ = 0;
    std::vector<int32_t> owners_, part_owners_; // of each voxel; the second empty for models without parts
    std::vector<SceneObject> objects_;
};

} // namespace semrover
