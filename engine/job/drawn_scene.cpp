// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/drawn_scene.h"

#include "engine/conditioning/cell_objects.h"
#include "engine/format/splat_file.h"
#include "engine/scene/palette.h"
#include "engine/scene/scene_fields.h"
#include "engine/splat/blocks.h"
#include "runtime/base/quote.h"

namespace semrover {

namespace {

Status check_instance(uint32_t id, std::string_view what)
{
    if (id < kMostInstances)
        return {};
    return fail(ErrorCode::bad_input, "{} {}: pictures of instances have ids up to {}", what, id, kMostInstances - 1);
}

Result<SceneActors> actors_of(const DrawOptions& o, std::span<const SceneObject> objects)
{
    for (const SceneObject& object : o.objects)
        if (!object.part)
            SR_CHECK(check_instance(object.id, "object"));
    for (const Actor& actor : o.actors)
        SR_CHECK(check_instance(actor.id, "actor"));
    return SceneActors::create(o.actors, by_id(objects));
}

// of points, or of voxels where there are none; empty where nobody asks
Result<std::vector<uint32_t>> owners_of(const VoxelGrid& grid, const DrawOptions& o)
{
    if (!o.instances && o.actors.empty())
        return std::vector<uint32_t>();
    return instances_of_points(grid, o.objects);
}

// owners: as owners_of() has them
Result<SplatScene> scene_of(Device& device, const VoxelGrid& grid, const Path& name, const DrawOptions& o,
                            std::vector<uint32_t> owners)
{
    ScenePoints points = points_of(grid);
    if (points.size() == 0 && !o.semantic)
        return fail(ErrorCode::bad_input, "{} has no points yet: generate them, or draw its labels with `semantic`",
                    quote_path(name));
    if (points.size() == 0) {
        const Blocks blocks = block_splats(grid);
        std::vector<uint32_t> of_splats;
        for (const uint32_t cell : blocks.cells)
            of_splats.push_back(owners.empty() ? 0 : owners[cell]);
        return SplatScene::create(device, blocks.splats, of_splats);
    }
    points.owners = std::move(owners);
    if (o.semantic)
        color_by_label(points);
    return SplatScene::create(device, points, o.splats);
}

Result<SplatScene> scene_of(Device& device, const Splats& splats, bool semantic, uint32_t owner)
{
    const std::vector<uint32_t> owners(splats.position.size(), owner);
    if (!semantic)
        return SplatScene::create(device, splats, owners);
    Splats colored = splats;
    for (size_t i = 0; i < colored.label.size(); ++i)
        colored.color[i] = label_color(colored.label[i]);
    return SplatScene::create(device, colored, owners);
}

// of an actor that has a file; none of one that is cut out of the scene
Result<std::optional<SplatScene>> scene_of(Device& device, const Actor& actor, const DrawOptions& o, uint32_t owner)
{
    std::optional<SplatScene> scene;
    if (const auto* of_grid = std::get_if<GridOfActor>(&actor.from)) {
        SR_TRY(const VoxelGrid grid, read_grid(of_grid->path));
        const size_t rows = grid.has_points() ? grid.points.size() / 3 : grid.cells.size();
        SR_TRY(scene, scene_of(device, grid, of_grid->path, o, std::vector<uint32_t>(rows, owner)));
    } else if (const auto* of_splats = std::get_if<SplatsOfActor>(&actor.from)) {
        SR_TRY(const SplatFile file, read_splats_ply(of_splats->path));
        SR_TRY(scene, scene_of(device, file.splats, o.semantic, owner));
    }
    return scene;
}

// the scene and those of actors that have files
Result<DrawnScene> with_actors(Device& device, SplatScene scene, SceneActors actors, const DrawOptions& o)
{
    std::vector<SplatScene> parts;
    parts.push_back(std::move(scene));
    for (const Actor& actor : actors.all()) {
        SR_TRY(std::optional<SplatScene> own, scene_of(device, actor, o, instance_number(actor.id)));
        if (own)
            parts.push_back(std::move(*own));
    }
    if (parts.size() == 1)
        return DrawnScene{std::move(parts.front()), std::move(actors)};
    SR_TRY(SplatScene joined, SplatScene::joined(device, parts));
    return DrawnScene{std::move(joined), std::move(actors)};
}

} // namespace

RasterizerOptions DrawOptions::rasterizer(const PictureEncoding& files) const
{
    RasterizerOptions options;
    options.visible_alpha = visible_alpha.value_or(options.visible_alpha);
    options.screen_variance = screen_variance;
    options.pixels_over = background;
    options.depth_units = float(units_per_metre(files.depth));
    options.instances = instances;
    options.movers = uint32_t(actors.size());
    for (const Actor& actor : actors)
        options.mover_numbers = std::max(options.mover_numbers, actor.id + 2);
    return options;
}

Result<DrawnScene> splats_of(Device& device, const VoxelGrid& grid, const Path& name, const DrawOptions& o)
{
    SR_TRY(SceneActors actors, actors_of(o, o.objects));
    SR_TRY(std::vector<uint32_t> owners, owners_of(grid, o));
    SR_TRY(SplatScene scene, scene_of(device, grid, name, o, std::move(owners)));
    return with_actors(device, std::move(scene), std::move(actors), o);
}

Result<DrawnScene> splats_of(Device& device, const Splats& splats, const DrawOptions& o)
{
    SR_TRY(SceneActors actors, actors_of(o, {})); // none can be cut out
    SR_TRY(SplatScene scene, scene_of(device, splats, o.semantic, 0));
    return with_actors(device, std::move(scene), std::move(actors), o);
}

} // namespace semrover
