// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// nuScenes' tables of annotations. Source: the page of the schema, and Box, of nutonomy/nuscenes-devkit
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"
#include "tools/dataset/object_boxes.h"
#include "tools/trajectory/json_tables.h"

#include <algorithm>
#include <set>

namespace semrover {

namespace {

struct Annotation {
    size_t number = 0; // of the record
    std::string instance;
    Rigid pose;
    Point3 size;
    double points = 0; // of the lidar, in the box
};

using Tokens = std::map<std::string, std::string, std::less<>>;

Result<Rigid> pose_of_record(const Json& json, std::string_view where)
{
    SR_TRY(const Point3 place, numbers_at<3>(json, "translation", where));
    SR_TRY(const auto q, numbers_at<4>(json, "rotation", where)); // w first
    return rigid_from_quaternion(place, {q[1], q[2], q[3], q[0]}, where);
}

Result<Annotation> parse_annotation(const Json& json, std::string_view where)
{
    Annotation a;
    SR_TRY(a.instance, text_at(json, "instance_token", where));
    SR_TRY(a.pose, pose_of_record(json, where));
    SR_TRY(const Point3 size, numbers_at<3>(json, "size", where)); // width, length, height
    a.size = {size[1], size[0], size[2]};
    SR_TRY(const auto points, optional_number(json, "num_lidar_pts", where));
    a.points = points.value_or(0);
    return a;
}

// of the sample; or of each instance that with the most points of the lidar, of equals the first
Result<std::vector<Annotation>> read_annotations(const Path& path, const std::string& sample)
{
    std::vector<Annotation> all;
    std::map<std::string, size_t, std::less<>> of_instance;
    size_t number = 0;
    const Status read = for_each_record(path, [&](const Json& json, std::string_view where) -> Status {
        const size_t own = number++;
        SR_TRY(const std::string token, text_at(json, "sample_token", where));
        if (!sample.empty() && token != sample)
            return {};
        SR_TRY(Annotation a, parse_annotation(json, where));
        a.number = own;
        const auto [at, added] = of_instance.emplace(a.instance, all.size());
        if (!added && !sample.empty())
            return fail(ErrorCode::bad_input, "{}: instance {} is annotated twice in the sample", where,
                        quote(a.instance, 60));
        if (added && all.size() == kMaxObjects)
            return fail(ErrorCode::bad_input, "{}: expected at most {} instances, found more", where, kMaxObjects);
        if (added)
            all.push_back(std::move(a));
        else if (a.points > all[at->second].points)
            all[at->second] = std::move(a);
        return {};
    });
    SR_CHECK(read);
    if (all.empty() && !sample.empty())
        return fail(ErrorCode::bad_input, "{}: no annotation of the sample {}", quote_path(path), quote(sample, 60));
    return all;
}

// `value` of the records whose `token` is one of `wanted`
Result<Tokens> look_up(const Path& path, const std::set<std::string, std::less<>>& wanted, const char* value)
{
    Tokens found;
    const Status read = for_each_record(path, [&](const Json& json, std::string_view where) -> Status {
        SR_TRY(const std::string token, text_at(json, "token", where));
        if (!wanted.contains(token))
            return {};
        SR_TRY(const std::string text, text_at(json, value, where));
        if (!found.emplace(token, text).second)
            return fail(ErrorCode::bad_input, "{}: token {} is given twice", where, quote(token, 60));
        return {};
    });
    SR_CHECK(read);
    for (const std::string& token : wanted)
        if (!found.contains(token))
            return fail(ErrorCode::bad_input, "{}: no record with the token {}", quote_path(path), quote(token, 60));
    return found;
}

// the vehicle at the sample: of the key frame of the lidar on the roof
Result<Rigid> read_vehicle_pose(const Path& folder, const std::string& sample)
{
    std::string pose;
    const Status read =
        for_each_record(folder / "sample_data.json", [&](const Json& json, std::string_view where) -> Status {
            SR_TRY(const std::string token, text_at(json, "sample_token", where));
            const auto key = json.find("is_key_frame");
            if (token != sample || key == json.end() || *key != true)
                return {};
            SR_TRY(const std::string file, text_at(json, "filename", where));
            if (file.find("LIDAR_TOP") != std::string::npos) {
                SR_TRY(pose, text_at(json, "ego_pose_token", where));
            }
            return {};
        });
    SR_CHECK(read);
    if (pose.empty())
        return fail(ErrorCode::bad_input, "{}: no key frame of LIDAR_TOP for the sample {}",
                    quote_path(folder / "sample_data.json"), quote(sample, 60));
    std::optional<Rigid> found;
    const Status found_pose =
        for_each_record(folder / "ego_pose.json", [&](const Json& json, std::string_view where) -> Status {
            SR_TRY(const std::string token, text_at(json, "token", where));
            if (token == pose) {
                SR_TRY(found, pose_of_record(json, where));
            }
            return {};
        });
    SR_CHECK(found_pose);
    if (!found)
        return fail(ErrorCode::bad_input, "{}: no record with the token {}", quote_path(folder / "ego_pose.json"),
                    quote(pose, 60));
    return *found;
}

} // namespace

std::span<const SourceLabel> nuscenes_box_labels()
{
    static const LabelTable table = read_label_table("nuscenes").value();
    static const std::vector<SourceLabel> labels = source_labels(table);
    return labels;
}

Status read_nuscenes_boxes(const Path& path, const BoxOptions& options, BoxCollector& to)
{
    if (options.vehicle_frame && options.sample.empty())
        return fail(ErrorCode::usage, "`vehicle_frame` needs `sample`: the vehicle moves");
    const Path folder = path.parent_path();
    SR_TRY(const std::vector<Annotation> annotations, read_annotations(path, options.sample));
    std::set<std::string, std::less<>> wanted;
    for (const Annotation& a : annotations)
        wanted.insert(a.instance);
    SR_TRY(const Tokens categories, look_up(folder / "instance.json", wanted, "category_token"));
    wanted.clear();
    for (const auto& [instance, category] : categories)
        wanted.insert(category);
    SR_TRY(const Tokens names, look_up(folder / "category.json", wanted, "name"));
    Rigid to_frame = kIdentity;
    if (options.vehicle_frame) {
        SR_TRY(const Rigid vehicle, read_vehicle_pose(folder, options.sample));
        to_frame = inverse(vehicle);
    }
    for (const Annotation& a : annotations) {
        const std::string& name = names.find(categories.find(a.instance)->second)->second;
        SR_CHECK(to.add({.label = name, .pose = compose(to_frame, a.pose), .size = a.size},
                        fmt::format("{} record {}", quote_path(path), a.number)));
    }
    return {};
}

} // namespace semrover
