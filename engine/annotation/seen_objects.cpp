// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/annotation/seen_objects.h"

#include "engine/scene/scene_fields.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace semrover {

namespace {

constexpr double kNear = 0.2;                        // metres, as splats are drawn
constexpr double kUsualFill = 0.7, kUsualPixels = 8; // of a box, before any pixel is counted
constexpr uint64_t kMostRays = 4096;                 // of an object's box, about

struct Pixels {
    uint32_t count = 0, left = UINT32_MAX, top = UINT32_MAX, right = 0, bottom = 0; // the last two excluded

    void add(uint32_t x, uint32_t end, uint32_t y)
    {
        count += end - x;
        left = std::min(left, x);
        right = std::max(right, end);
        top = std::min(top, y);
        bottom = std::max(bottom, y + 1);
    }
};

std::unordered_map<uint32_t, Pixels> count_pixels(const InstancePicture& picture)
{
    std::unordered_map<uint32_t, Pixels> found;
    for (uint32_t y = 0; y < picture.height; ++y) {
        const uint32_t* row = picture.numbers.data() + size_t(y) * picture.width;
        for (uint32_t x = 0; x < picture.width;) {
            uint32_t end = x + 1;
            while (end < picture.width && row[end] == row[x])
                ++end;
            if (row[x])
                found[row[x]].add(x, end, y);
            x = end;
        }
    }
    return found;
}

// rays of every so many pixels of the area, in both directions
double occlusion_of(const SeenObject& object, const PlacedBox& box, const BoxProjection& projection,
                    const InstancePicture& picture)
{
    const PictureBox area = projection.inside(object.amodal);
    const uint32_t left = uint32_t(area.left), top = uint32_t(area.top);
    const uint32_t right = std::min(picture.width, uint32_t(std::ceil(area.right)));
    const uint32_t bottom = std::min(picture.height, uint32_t(std::ceil(area.bottom)));
    const uint32_t step = std::max(1u, uint32_t(std::sqrt(area.area() / kMostRays)));
    double shown = 0, hidden = 0, empty = 0;
    for (uint32_t y = top; y < bottom; y += step)
        for (uint32_t x = left; x < right; x += step) {
            const size_t pixel = size_t(y) * picture.width + x;
            const auto depths = projection.depths(box, x, y);
            if (!depths)
                continue;
            if (picture.numbers[pixel] == instance_number(object.id)) {
                ++shown;
                continue;
            }
            const double depth = picture.depth(pixel), middle = ((*depths)[0] + (*depths)[1]) / 2;
            ++(depth > 0 && depth < middle ? hidden : empty);
        }
    const double fill = (shown + kUsualPixels * kUsualFill) / (shown + empty + kUsualPixels);
    return shown + hidden > 0 ? fill * hidden / (shown + fill * hidden) : 0;
}

} // namespace

PlacedObject placed(const SceneObject& o)
{
    return {o.id, o.label, {box_to_world(o), o.size}};
}

std::vector<SeenObject> seen_objects(const CameraFrame& frame, const InstancePicture& picture,
                                     std::span<const PlacedObject> objects)
{
    const auto pixels = count_pixels(picture);
    const BoxProjection projection(frame, kNear);
    std::vector<SeenObject> seen;
    for (const PlacedObject& o : objects) {
        const auto found = pixels.find(instance_number(o.id));
        if (found == pixels.end())
            continue;
        const Pixels& p = found->second;
        SeenObject object{o, p.count, {double(p.left), double(p.top), double(p.right), double(p.bottom)}, {}, 0, 0};
        const PlacedBox box{compose(frame.pose.world_to_camera, o.box.pose), o.box.size};
        // splats may be seen beside a box that is not
        object.amodal = projection.amodal(box).value_or(object.visible);
        object.truncation = projection.outside(object.amodal);
        object.occlusion = occlusion_of(object, box, projection, picture);
        seen.push_back(std::move(object));
    }
    std::ranges::sort(seen, {}, &SeenObject::id);
    return seen;
}

} // namespace semrover
