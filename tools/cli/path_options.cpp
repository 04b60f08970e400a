// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/path_options.h"

#include "runtime/base/quote.h"
#include "tools/cli/number_option.h"
#include "tools/cli/origin_option.h"
#include "tools/dataset/rigid_file.h"

#include <array>
#include <CLI/CLI.hpp>
#include <cmath>
#include <nlohmann/json.hpp>

namespace semrover {

namespace {

Result<Rigid> world_option(const std::string& text)
{
    if (is_file(text))
        return read_rigid(text);
    if (text.find(',') == std::string::npos && text.find(' ') == std::string::npos)
        return fail(ErrorCode::bad_input,
                    "--world: there is no file {}; it takes one, or 12 or 16 numbers with commas "
                    "between them",
                    quote(text));
    return parse_rigid(text, "--world");
}

Result<uint64_t> frame_option(const std::string& text)
{
    if (text == "first")
        return PathPlacement::kFirst;
    const auto number = parse_number<uint64_t>(text, {0, 1ull << 53});
    if (!number)
        return fail(ErrorCode::usage, "--relative-to takes first or the number of a frame, not {}", quote(text, 60));
    return *number;
}

} // namespace

void add_placement_options(CLI::App& c, PathOptions& o)
{
    const std::string group = "Where the trajectory lies in the grid's world, in the order that they apply";
    c.add_option(
         "--relative-to", o.relative_to,
         "first or FRAME: poses relative to that frame's, for a grid in its frame. FRAME is the number that the "
         "file gives it, else counted from 0")
        ->group(group);
    if (!c.get_option_no_throw("--calib"))
        c.add_option(
             "--calib", o.calibration,
             "KITTI's calib.txt: its camera's poses become the lidar's (Tr), for a grid in the lidar's frame; of "
             "the first frame without --relative-to")
            ->group(group);
    c.add_option("--world", o.world,
                 "the path's world to the grid's: 12 or 16 numbers, row-major, with commas between them, or a file of "
                 "them (text, .json, .npy)")
        ->group(group);
    c.add_option(c.get_option_no_throw("--origin") ? "--path-origin" : "--path-origin,--origin", o.origin,
                 "X,Y,Z: where the path's origin lies in the grid's world, metres; it is added to positions")
        ->group(group);
}

std::span<const std::string_view> placement_options()
{
    static constexpr std::array<std::string_view, 4> kNames = {"--relative-to", "--calib", "--world", "--path-origin"};
    return kNames;
}

nlohmann::json json_of(const PathOptions& o)
{
    nlohmann::json json = nlohmann::json::object();
    for (const auto& [name, text] : {std::pair{"relative_to", &o.relative_to},
                                     {"calib", &o.calibration},
                                     {"world", &o.world},
                                     {"origin", &o.origin}})
        if (!text->empty())
            json[name] = *text;
    return json;
}

Result<PathPlacement> placement_of(const PathOptions& o)
{
    PathPlacement placement;
    if (!o.relative_to.empty()) {
        SR_TRY(placement.relative_to, frame_option(o.relative_to));
    }
    if (!o.calibration.empty()) {
        SR_TRY(placement.lidar_to_camera, read_kitti_lidar(o.calibration));
    }
    if (!o.world.empty()) {
        SR_TRY(placement.world, world_option(o.world));
    }
    SR_TRY(placement.origin, origin_from(o.origin));
    return placement;
}

} // namespace semrover
