// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/annotation/box_lines.h"

#include "engine/annotation/json_lines.h"
#include "engine/scene/palette.h"
#include "engine/scene/scene_fields.h"
#include "runtime/base/json_numbers.h"

#include <algorithm>

namespace semrover {

namespace {

using OrderedJson = nlohmann::ordered_json;

constexpr double kPerPixel = 1e2, kPerUnit = 1e6;

template <size_t N>
std::array<double, N> all_rounded(std::array<double, N> values, double per_unit)
{
    for (double& v : values)
        v = rounded_to(v, per_unit);
    return values;
}

OrderedJson pose_json(const Rigid& pose)
{
    return {{"center", all_rounded(translation_of(pose), kPerMetre)},
            {"rotation", all_rounded(quaternion_of(pose), kPerUnit)}};
}

std::array<double, 4> corners_of(const PictureBox& box)
{
    return all_rounded(std::array{box.left, box.top, box.right, box.bottom}, kPerPixel);
}

OrderedJson object_line(const SeenObject& o, const Rigid& world_to_vehicle, const Rigid& world_to_camera)
{
    return {{"id", o.id},
            {"class", std::string(kPalette[o.label].name)},
            {"size", all_rounded(o.box.size, kPerMetre)},
            {"world", pose_json(o.box.pose)},
            {"ego", pose_json(compose(world_to_vehicle, o.box.pose))},
            {"camera", pose_json(compose(world_to_camera, o.box.pose))},
            {"amodal", corners_of(o.amodal)},
            {"visible", corners_of(o.visible)},
            {"pixels", o.pixels},
            {"truncation", rounded_to(o.truncation, kPerUnit)},
            {"occlusion", rounded_to(o.occlusion, kPerUnit)}};
}

Result<PictureBox> picture_box(const Json& object, const char* key, std::string_view where)
{
    SR_TRY(const auto v, numbers_at<4>(object, key, where));
    if (!(v[0] <= v[2] && v[1] <= v[3]))
        return fail(ErrorCode::bad_input, "{}: {}: expected left, top, right, bottom", where, key);
    return PictureBox{v[0], v[1], v[2], v[3]};
}

Result<double> share(const Json& object, const char* key, std::string_view where)
{
    const auto entry = object.find(key);
    if (entry == object.end() || !entry->is_number() || !(*entry >= 0 && *entry <= 1))
        return fail(ErrorCode::bad_input, "{}: {}: expected a number from 0 to 1", where, key);
    return entry->get<double>();
}

Result<SeenObject> parse_seen(const Json& json, std::string_view where)
{
    constexpr std::string_view kKeys[] = {"id",     "class",   "size",   "world",      "ego",      "camera",
                                          "amodal", "visible", "pixels", "truncation", "occlusion"};
    if (!json.is_object() || !json.value("world", Json()).is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object with its place in the world", where);
    SR_CHECK(check_keys(json, kKeys, where));
    SeenObject o;
    SR_TRY(const int64_t id, whole_number(json, "id", where));
    SR_TRY(const int64_t pixels, whole_number(json, "pixels", where));
    SR_TRY(const std::string name, text_of(json, "class", where));
    const auto label = class_of_name(name);
    if (id < 0 || id > UINT32_MAX || pixels < 0 || pixels > UINT32_MAX || !label)
        return fail(ErrorCode::bad_input, "{}: expected an id, pixels and a class of ours", where);
    o.id = uint32_t(id);
    o.pixels = uint32_t(pixels);
    o.label = *label;
    SR_TRY(o.box.size, numbers_at<3>(json, "size", where));
    SR_TRY(const Point3 center, numbers_at<3>(json["world"], "center", where));
    SR_TRY(const Quaternion rotation, numbers_at<4>(json["world"], "rotation", where));
    SR_TRY(o.box.pose, rigid_from_quaternion(center, rotation, where));
    SR_TRY(o.amodal, picture_box(json, "amodal", where));
    SR_TRY(o.visible, picture_box(json, "visible", where));
    SR_TRY(o.truncation, share(json, "truncation", where));
    SR_TRY(o.occlusion, share(json, "occlusion", where));
    return o;
}

} // namespace

std::string box_line(const DriveRecord::Picture& picture, std::span<const SeenObject> objects,
                     const Rigid& world_to_vehicle, const Rigid& world_to_camera)
{
    OrderedJson list = OrderedJson::array();
    for (const SeenObject& o : objects)
        list.push_back(object_line(o, world_to_vehicle, world_to_camera));
    return json_text(OrderedJson{
        {"time", picture.time}, {"camera", picture.camera}, {"number", picture.number}, {"objects", std::move(list)}});
}

Result<std::vector<SeenPicture>> read_box_lines(const Path& file)
{
    constexpr std::string_view kKeys[] = {"time", "camera", "number", "objects"};
    std::vector<SeenPicture> pictures;
    SR_CHECK(read_json_lines(file, kKeys, [&](const Json& line, const std::string& where) -> Status {
        SeenPicture p;
        SR_TRY(p.picture.time, whole_number(line, "time", where));
        SR_TRY(p.picture.camera, text_of(line, "camera", where));
        SR_TRY(const int64_t number, whole_number(line, "number", where));
        if (number < 0 || number > 999999)
            return fail(ErrorCode::bad_input, "{}: number: expected 0 to 999999, found {}", where, number);
        p.picture.number = uint32_t(number);
        SR_CHECK(check_array(line.value("objects", Json()), "objects", where));
        for (const Json& object : line["objects"]) {
            SR_TRY(SeenObject o, parse_seen(object, fmt::format("{} object {}", where, p.objects.size())));
            p.objects.push_back(std::move(o));
        }
        pictures.push_back(std::move(p));
        return {};
    }));
    return pictures;
}

} // namespace semrover
