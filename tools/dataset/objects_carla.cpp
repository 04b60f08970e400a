// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// Boxes of CARLA, which has no file for them: the layout is ours (docs/formats.md §3.1), its contents are those of
// carla.BoundingBox, carla.Transform and carla.Actor. Source: the Python API's reference and the catalogue of vehicles,
// https://carla.readthedocs.io
#include "runtime/base/json_fields.h"
#include "runtime/base/quote.h"
#include "tools/dataset/object_boxes.h"
#include "tools/trajectory/json_tables.h"

#include <charconv>
#include <cmath>
#include <numbers>

namespace semrover {

namespace {

constexpr JsonLimits kCarlaFile{.bytes = 256u << 20, .values = 1 << 12}; // values of a box

// beside carla.CityObjectLabel, whose numbers and names are a table: base types of vehicles, kinds of blueprints, our
// own names where they are none of these, and blueprints of vehicles
constexpr SourceLabel kMoreLabels[] = {
    {100, "car", 13},
    {101, "van", 13},
    {102, "truck", 14},
    {103, "bus", 15},
    {104, "motorcycle", 17},
    {105, "bicycle", 18},
    {106, "walker.pedestrian", 11},
    {107, "traffic.traffic_light", 6},
    {108, "traffic", 7}, // speed limits, stop, yield
    {110, "road", 0},
    {111, "sidewalk", 1},
    {112, "building", 2},
    {113, "wall", 3},
    {114, "fence", 4},
    {115, "pole", 5},
    {116, "traffic light", 6},
    {117, "traffic sign", 7},
    {118, "vegetation", 8},
    {119, "terrain", 9},
    {120, "sky", 10},
    {121, "person", 11},
    {122, "rider", 12},
    {123, "train", 16},
    {124, "road-lane", 19},
    {200, "vehicle.bh.crossbike", 18},
    {201, "vehicle.diamondback.century", 18},
    {202, "vehicle.gazelle.omafiets", 18},
    {203, "vehicle.harley-davidson.low_rider", 17},
    {204, "vehicle.kawasaki.ninja", 17},
    {205, "vehicle.vespa.zx125", 17},
    {206, "vehicle.yamaha.yzf", 17},
    {207, "vehicle.carlamotors.carlacola", 14},
    {208, "vehicle.carlamotors.firetruck", 14},
    {209, "vehicle.sixwheeltruck.sixwheeltruck", 14},
    {210, "vehicle.tesla.cybertruck", 14},
    {211, "vehicle.mitsubishi.fusorosa", 15},
    {212, "vehicle.ford.ambulance", 13}, // vans
    {213, "vehicle.mercedes.sprinter", 13},
    {214, "vehicle.volkswagen.t2", 13},
    {215, "vehicle.volkswagen.t2_2021", 13},
    {216, "vehicle.audi.a2", 13},
    {217, "vehicle.audi.etron", 13},
    {218, "vehicle.audi.tt", 13},
    {219, "vehicle.bmw.grandtourer", 13},
    {220, "vehicle.chevrolet.impala", 13},
    {221, "vehicle.citroen.c3", 13},
    {222, "vehicle.dodge.charger_2020", 13},
    {223, "vehicle.dodge.charger_police", 13},
    {224, "vehicle.dodge.charger_police_2020", 13},
    {225, "vehicle.ford.crown", 13},
    {226, "vehicle.ford.mustang", 13},
    {227, "vehicle.jeep.wrangler_rubicon", 13},
    {228, "vehicle.lincoln.mkz_2017", 13},
    {229, "vehicle.lincoln.mkz_2020", 13},
    {230, "vehicle.mercedes.coupe", 13},
    {231, "vehicle.mercedes.coupe_2020", 13},
    {232, "vehicle.micro.microlino", 13},
    {233, "vehicle.mini.cooper_s", 13},
    {234, "vehicle.mini.cooper_s_2021", 13},
    {235, "vehicle.nissan.micra", 13},
    {236, "vehicle.nissan.patrol", 13},
    {237, "vehicle.nissan.patrol_2021", 13},
    {238, "vehicle.seat.leon", 13},
    {239, "vehicle.tesla.model3", 13},
    {240, "vehicle.toyota.prius", 13},
};

constexpr std::array<std::string_view, 14> kBoxKeys = {"class",   "id",         "type",   "tags",     "base_type",
                                                       "type_id", "location",   "extent", "rotation", "transform",
                                                       "color",   "attributes", "name",   "comment"};
constexpr std::array<std::string_view, 3> kTransformKeys = {"location", "rotation", "comment"};

// an array of 3 numbers, or an object with these names
Result<Point3> triple_at(const Json& object, const char* key, const std::array<const char*, 3>& names,
                         std::string_view where)
{
    const auto entry = object.find(key);
    if (entry == object.end() || !entry->is_object())
        return numbers_at<3>(object, key, where);
    Point3 values{};
    for (size_t i = 0; i < 3; ++i) {
        const auto number = entry->find(names[i]);
        if (number == entry->end())
            return fail(ErrorCode::bad_input, "{}: {}: {} is missing", where, key, names[i]);
        SR_TRY(values[i], finite_number(*number, fmt::format("{}: {}: {}", where, key, names[i])));
    }
    return values;
}

// CARLA's axes are x forward, y right, z up, and so left-handed; turning over y makes them ours. The rotation's columns
// are the directions ahead, to the right and up: yaw turns from x towards y, pitch lifts x, roll lowers the right side.
Result<Rigid> pose_at(const Json& object, std::string_view where)
{
    SR_TRY(const Point3 place, triple_at(object, "location", {"x", "y", "z"}, where));
    SR_TRY(const Point3 turn, triple_at(object, "rotation", {"pitch", "yaw", "roll"}, where));
    const auto radians = [](double degrees) { return std::remainder(degrees, 360.0) * std::numbers::pi / 180; };
    const double cp = std::cos(radians(turn[0])), sp = std::sin(radians(turn[0]));
    const double cy = std::cos(radians(turn[1])), sy = std::sin(radians(turn[1]));
    const double cr = std::cos(radians(turn[2])), sr = std::sin(radians(turn[2]));
    const Point3 ahead = {cp * cy, cp * sy, sp};
    const Point3 right = {cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, -cp * sr};
    const Point3 up = {-cy * sp * cr - sy * sr, -sy * sp * cr + cy * sr, cp * cr};
    return Rigid{ahead[0],  -right[0], up[0],  place[0],  //
                 -ahead[1], right[1],  -up[1], -place[1], //
                 ahead[2],  -right[2], up[2],  place[2],  0, 0, 0, 1};
}

// of the box itself, or of the actor's attributes
const Json* find_attribute(const Json& box, const char* key)
{
    if (const auto own = box.find(key); own != box.end())
        return &*own;
    const auto attributes = box.find("attributes");
    if (attributes == box.end() || !attributes->is_object())
        return nullptr;
    const auto entry = attributes->find(key);
    return entry == attributes->end() ? nullptr : &*entry;
}

std::string label_of_tag(double tag)
{
    for (const SourceLabel& label : carla_box_labels())
        if (label.number < kMoreLabels[0].number && tag == label.number)
            return std::string(label.name);
    return fmt::format("tag {}", tag);
}

// blueprints come in kinds: walker.pedestrian.0012, traffic.speed_limit.30
std::string label_of_blueprint(const std::string& id)
{
    for (const std::string_view kind : {"walker.pedestrian", "traffic.traffic_light", "traffic"})
        if (id == kind || (id.starts_with(kind) && id[kind.size()] == '.'))
            return std::string(kind);
    return id;
}

Result<std::string> label_of(const Json& box, std::string_view where)
{
    for (const char* key : {"class", "type"})
        if (box.contains(key))
            return text_at(box, key, where);
    if (const auto tags = box.find("tags"); tags != box.end()) {
        if (!tags->is_array() || tags->empty())
            return fail(ErrorCode::bad_input, "{}: tags: expected an array of numbers", where);
        SR_TRY(const double tag, finite_number(tags->front(), fmt::format("{}: tags", where)));
        return label_of_tag(tag);
    }
    const Json* base = find_attribute(box, "base_type");
    if (base && base->is_string() && !base->get_ref<const std::string&>().empty())
        return base->get<std::string>();
    if (!box.contains("type_id"))
        return fail(ErrorCode::bad_input, "{}: expected class, type, tags, base_type or type_id", where);
    SR_TRY(const std::string id, text_at(box, "type_id", where));
    return label_of_blueprint(id);
}

// "r,g,b", 0 to 255 each, as the attribute of a vehicle has it
Result<std::optional<std::array<double, 3>>> color_of(const Json& box, std::string_view where)
{
    const Json* color = find_attribute(box, "color");
    if (!color || color->is_null())
        return std::optional<std::array<double, 3>>();
    const std::string text = color->is_string() ? color->get<std::string>() : std::string();
    std::array<double, 3> tint{};
    const char *at = text.data(), *end = text.data() + text.size();
    for (size_t c = 0; c < 3; ++c) {
        unsigned level = 256;
        const auto [rest, error] = std::from_chars(at, end, level);
        if (error != std::errc() || level > 255 || (c < 2 ? rest == end || *rest != ',' : rest != end))
            return fail(ErrorCode::bad_input, "{}: color: expected \"r,g,b\" with numbers from 0 to 255, found {}",
                        where, color->is_string() ? quote(text, 40) : color->type_name());
        tint[c] = level / 255.0;
        at = c < 2 ? rest + 1 : rest;
    }
    return std::optional(tint);
}

Status add_box(const Json& json, std::string_view where, BoxCollector& to)
{
    if (!json.is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object, found {}", where, json.type_name());
    SR_CHECK(check_keys(json, kBoxKeys, where));
    SR_TRY(const std::string label, label_of(json, where));
    ForeignBox box{.label = label, .pose = {}, .size = {}};
    SR_TRY(box.pose, pose_at(json, where));
    if (const auto transform = json.find("transform"); transform != json.end()) {
        const std::string at = fmt::format("{}: transform", where);
        if (!transform->is_object())
            return fail(ErrorCode::bad_input, "{}: expected an object, found {}", at, transform->type_name());
        SR_CHECK(check_keys(*transform, kTransformKeys, at));
        SR_TRY(const Rigid actor, pose_at(*transform, at));
        box.pose = compose(actor, box.pose);
    }
    SR_TRY(const Point3 extent, triple_at(json, "extent", {"x", "y", "z"}, where));
    for (size_t a = 0; a < 3; ++a)
        box.size[a] = 2 * extent[a];
    SR_TRY(box.tint, color_of(json, where));
    if (const auto id = json.find("id"); id != json.end()) {
        if (!id->is_number_unsigned())
            return fail(ErrorCode::bad_input, "{}: id: expected a whole number", where);
        box.id = id->get<uint64_t>();
    }
    return to.add(box, where);
}

} // namespace

std::span<const SourceLabel> carla_box_labels()
{
    static const LabelTable tags = read_label_table("carla").value();
    static const std::vector<SourceLabel> labels = [] {
        std::vector<SourceLabel> all = source_labels(tags);
        all.insert(all.end(), std::begin(kMoreLabels), std::end(kMoreLabels));
        return all;
    }();
    return labels;
}

Status read_carla_boxes(const Path& path, const BoxOptions&, BoxCollector& to)
{
    const std::string name = quote_path(path);
    SR_TRY(const std::string text, read_text_file(path, kCarlaFile.bytes));
    return parse_json_records(text, name, kCarlaFile, [&](const Json& box, size_t i) {
        return add_box(box, fmt::format("{} box {}", name, i), to);
    });
}

} // namespace semrover
