// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/conditioning/voxel_conditions.h"

#include "engine/scene/palette.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace semrover {

namespace {

constexpr std::array kWaves = {1.0, 2.0, 4.0, 8.0}; // metres
constexpr double kNearestFace = -2, kFarthestFace = 8;

} // namespace

void object_condition(const SceneObject& object, const std::array<double, 3>& point, std::span<float> out)
{
    const std::array<double, 3> place = place_in(object, point);
    constexpr size_t kFaces = 6, kSines = 1 + kFaces, kCosines = kSines + kFaces * kWaves.size(),
                     kSize = kCosines + kFaces * kWaves.size();
    out[0] = 1;
    for (size_t face = 0; face < kFaces; ++face) {
        const double half = object.size[face / 2] / 2, at = place[face / 2];
        const double distance = std::clamp(face % 2 ? half + at : half - at, kNearestFace, kFarthestFace);
        out[1 + face] = float(distance / 4);
        for (size_t w = 0; w < kWaves.size(); ++w) {
            const double angle = distance * 2 * std::numbers::pi / kWaves[w];
            out[kSines + face * kWaves.size() + w] = float(std::sin(angle));
            out[kCosines + face * kWaves.size() + w] = float(std::cos(angle));
        }
    }
    for (size_t a = 0; a < 3; ++a)
        out[kSize + a] = float(std::log2(std::clamp(object.size[a], 1.0 / 16, 64.0)) / 4);
    out[kSize + 3] = float(std::sin(object.heading));
    out[kSize + 4] = float(std::cos(object.heading));
}

void tint_condition(const std::array<double, 3>& tint, std::span<float> out)
{
    out[0] = 1;
    for (size_t c = 0; c < 3; ++c)
        out[1 + c] = float(2 * tint[c] - 1);
}

void part_condition(const SceneObject& part, const std::array<double, 3>& point, std::span<float> out)
{
    constexpr size_t kBox = condition_width(ConditionPart::object);
    object_condition(part, point, out.first(kBox));
    if (part.tint)
        tint_condition(*part.tint, out.subspan(kBox));
}

Result<VoxelConditions> VoxelConditions::create(const TransformerConfig& config, const VoxelGrid& grid,
                                                std::span<const SceneObject> objects)
{
    VoxelConditions conditions;
    conditions.parts_ = config.condition;
    conditions.width_ = config.condition_width();
    conditions.voxel_size_ = double(grid.voxel_size);
    conditions.objects_.assign(objects.begin(), objects.end());
    if (conditions.width_ && !objects.empty()) {
        SR_TRY(conditions.owners_, objects_of_cells(grid, objects));
        if (std::ranges::count(config.condition, ConditionPart::part)) {
            SR_TRY(conditions.part_owners_, parts_of_cells(grid, objects));
        }
    }
    return conditions;
}

const SceneObject* VoxelConditions::of_cell(std::span<const int32_t> owners, uint32_t cell) const
{
    return owners.empty() || owners[cell] == kNoObject ? nullptr : &objects_[size_t(owners[cell])];
}

void VoxelConditions::row(uint32_t cell, const Cell& index, std::span<float> out) const
{
    std::ranges::fill(out, 0.f);
    if (empty())
        return;
    const SceneObject *object = of_cell(owners_, cell), *part = of_cell(part_owners_, cell);
    const std::array<double, 3> center = {(index[0] + 0.5) * voxel_size_, (index[1] + 0.5) * voxel_size_,
                                          (index[2] + 0.5) * voxel_size_};
    size_t at = 0;
    for (const ConditionPart entry : parts_) {
        const std::span<float> to = out.subspan(at, condition_width(entry));
        if (entry == ConditionPart::object && object && !is_ground(object->label))
            object_condition(*object, center, to);
        else if (entry == ConditionPart::tint && object && object->tint)
            tint_condition(*object->tint, to);
        else if (entry == ConditionPart::part && part)
            part_condition(*part, center, to);
        at += to.size();
    }
}

} // namespace semrover
