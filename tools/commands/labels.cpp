// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover labels: the classes of a grid's cells, with their numbers and colours; --vox FILE: as MagicaVoxel's palette
#include "engine/job/outputs.h"
#include "engine/scene/palette.h"
#include "runtime/base/json.h"
#include "tools/cli/commands.h"
#include "tools/dataset/scene_readers.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

std::string hex_of(const SemanticClass& c)
{
    return fmt::format("#{:02x}{:02x}{:02x}", c.color[0], c.color[1], c.color[2]);
}

// a voxel of each class, in a row
VoxelGrid voxels_of_classes()
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    for (int32_t label = 0; label < int32_t(kClassCount); ++label) {
        grid.cells.push_back({label, 0, 0});
        grid.labels.push_back(uint8_t(label));
    }
    return grid;
}

Status labels(const std::string& vox, const Globals& globals)
{
    if (!vox.empty()) {
        SR_CHECK(check_writable(vox, globals.yes));
        SR_CHECK(write_vox(vox, voxels_of_classes()));
    }
    Json list = Json::array();
    for (size_t i = 0; i < kClassCount; ++i)
        list.push_back({{"number", i}, {"name", std::string(kPalette[i].name)}, {"color", hex_of(kPalette[i])}});
    if (globals.json)
        fmt::print("{}\n", json_text(Json{{"labels", list}}));
    else
        for (const Json& c : list)
            fmt::print("{:>3}  {:<14}{}\n", c["number"].get<size_t>(), c["name"].get<std::string>(),
                       c["color"].get<std::string>());
    return {};
}

} // namespace

void add_labels(CLI::App& app, const Globals& globals, Run& run)
{
    auto vox = std::make_shared<std::string>();
    CLI::App* c = app.add_subcommand("labels", "the classes of voxels: number, name and colour");
    c->add_option("--vox", *vox, "also a MagicaVoxel file with one voxel of each class, and so its palette");
    c->callback([vox, &globals, &run] { run = [vox, &globals] { return labels(*vox, globals); }; });
}

} // namespace semrover
