// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/commands/convert.h"

#include "engine/world/world_objects.h"
#include "runtime/base/final_name.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/value_options.h"
#include "tools/commands/scene_input.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

Status check_output(const Path& in, const Path& out, const Globals& globals)
{
    std::error_code ignored;
    if (out.extension() != ".json")
        return fail(ErrorCode::usage, "{}: boxes become objects, in a file that ends with .json", quote_path(out));
    if (std::filesystem::equivalent(in, out, ignored))
        return fail(ErrorCode::usage, "IN and OUT are the same, {}", quote_path(out));
    return refuse_existing(out, globals.yes);
}

Json classes_of(std::span<const SceneObject> objects)
{
    Json counts = Json::object();
    for (const SceneObject& o : objects) {
        Json& count = counts[std::string(kPalette[o.label].name)];
        count = count.is_null() ? 1 : count.get<size_t>() + 1;
    }
    return counts;
}

} // namespace

void add_box_options(CLI::App& c, ConvertObjectsOptions& o)
{
    c.add_option("--calib", o.calibration, "of KITTI's boxes: the calibration; they come out in the lidar's frame");
    add_number(c, "--frame", o.frame, "of boxes of many frames: the number of one (KITTI), or its timestamp (Waymo)", 0,
               UINT64_MAX);
    c.add_option("--sample", o.sample, "of nuScenes' boxes: the token of a sample; by default each instance once");
    c.add_flag("--vehicle-frame", o.vehicle_frame, "of nuScenes' and Waymo's boxes: in the vehicle's frame");
}

Status guess_objects_of(const ObjectsInput& input, const SceneInputOptions& scene, const std::string& model_folder,
                        const Globals& globals)
{
    SR_CHECK(check_output(input.in, input.out, globals));
    if (model_folder.empty())
        return fail(ErrorCode::usage, "-m/--model is missing: it says how large objects usually are, and which colour");
    SR_TRY(const VoxfieldModel model, VoxfieldModel::open(model_folder));
    SR_TRY(const VoxelGrid grid, load_grid(input.in, scene, globals));
    SR_TRY(const std::vector<SceneObject> objects, conditioning_objects(model, {}, grid, scene.seed));
    if (objects.empty())
        return fail(ErrorCode::bad_input, "{}: nothing that the model knows the usual size of is in {}",
                    quote(model_folder), quote_path(input.in));
    if (!input.dry_run)
        SR_CHECK(write_objects(input.out, objects));
    const Json json{{"input", printable(input.in)},
                    {"output", printable(input.out)},
                    {"objects", objects.size()},
                    {"classes", classes_of(objects)}};
    if (globals.json)
        fmt::print("{}\n", json_text(json));
    else if (!globals.quiet)
        fmt::print("{} objects\n", objects.size());
    return {};
}

Status convert_objects(const ObjectsInput& input, BoxFormat format, const ConvertObjectsOptions& options,
                       const Globals& globals)
{
    SR_CHECK(check_output(input.in, input.out, globals));
    const BoxOptions boxes{.map = input.map,
                           .origin = input.origin,
                           .calibration = options.calibration,
                           .frame = options.frame,
                           .sample = options.sample,
                           .vehicle_frame = options.vehicle_frame};
    SR_TRY(const BoxFile file, read_box_file(input.in, format, boxes));
    if (!input.dry_run)
        SR_CHECK(write_objects(input.out, file.objects));
    print_warnings(file.warnings, globals);
    const Json json{
        {"input", printable(input.in)},   {"output", printable(input.out)},      {"from", std::string(name_of(format))},
        {"objects", file.objects.size()}, {"classes", classes_of(file.objects)}, {"dropped", file.dropped},
        {"warnings", file.warnings}};
    if (globals.json)
        fmt::print("{}\n", json_text(json));
    else if (!globals.quiet)
        fmt::print("{} to objects: {} objects, {} left out\n", name_of(format), file.objects.size(), file.dropped);
    return {};
}

} // namespace semrover
