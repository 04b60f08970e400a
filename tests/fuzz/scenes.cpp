// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// grids, points and splats, ours and other programs'
#include "engine/format/label_map.h"
#include "engine/format/labelled_points.h"
#include "engine/format/npy.h"
#include "engine/format/splat_file.h"
#include "engine/scene/grid.h"
#include "engine/scene/tiles.h"
#include "tests/fuzz/fuzz_target.h"
#include "tools/dataset/npz.h"
#include "tools/dataset/scene_file.h"
#include "tools/dataset/scene_readers.h"

namespace semrover::fuzz {

namespace scenes {

// a grid that a reader gives is one that the writer takes
void check(const Result<SceneGrid>& scene)
{
    if (!accepts(scene))
        return;
    if (const Status status = check_grid(scene->grid, "grid"); !status)
        found("a reader gives a grid that is none: " + status.error().message);
}

void grid(Bytes input)
{
    const auto read = read_grid(InputFile(input, "g.sgrid"));
    if (accepts(read))
        if (const Status status = check_grid(*read, "grid"); !status)
            found("read_grid gives what is none: " + status.error().message);
}

void tiles(Bytes input)
{
    const InputFolder folder(input, "tiles.json");
    (void)accepts(read_grid_or_tiles(folder));
}

void npz(Bytes input)
{
    const InputFile file(input, "g.npz");
    if (const auto archive = NpzFile::open(file); accepts(archive))
        for (const std::string& name : archive->names())
            (void)accepts(archive->read(name, kMebibyte));
    check(read_grid_npz(file, {}));
    check(read_label_array(file, {}));
    check(read_occ3d(file, Occ3dKind::nuscenes, {}));
    check(read_occ3d(file, Occ3dKind::waymo, {}));
}

void npy(Bytes input)
{
    check(read_label_array(InputFile(input, "g.npy"), {}));
}

void vox(Bytes input)
{
    SceneGridOptions options;
    options.nearest_color = true;
    check(read_vox(InputFile(input, "g.vox"), options));
}

void semantic_kitti(Bytes input)
{
    const InputFolder folder(input, "000000.bin");
    check(read_semantic_kitti(folder.first(), {}));
}

void labelled_points(Bytes input)
{
    const InputFile file(input, "p.ply");
    check(read_labelled_points(file, {}));
    check(read_carla_points(file, {}));
}

void splats_ply(Bytes input)
{
    (void)accepts(read_splats_ply(InputFile(input, "s.ply")));
}

void dot_splat(Bytes input)
{
    (void)accepts(read_dot_splat(InputFile(input, "s.splat")));
}

void splats_glb(Bytes input)
{
    (void)accepts(read_splats_glb(InputFile(input, "s.glb")));
}

void scene_file(Bytes input)
{
    const InputFolder folder(input, "scene");
    const Path path = folder.first();
    if (const auto format = detect_scene_format(path); accepts(format)) {
        if (facts_of(*format).splats)
            (void)accepts(read_splats(path, *format));
        else
            check(read_scene_grid(path));
    }
}

void label_table(Bytes input)
{
    (void)accepts(read_label_table(InputFile(input, "map.json")));
}

constexpr FuzzTarget kTargets[] = {
    {"grid", "*.sgrid *.safetensors", grid},
    {"tiles", "*.folder", tiles, 32 << 10},
    {"npz", "*.npz", npz, 16 << 10, 1024, 64 * kMebibyte}, // zip's deflate: 1032 times the file
    {"npy", "*.npy", npy},
    {"vox", "*.vox", vox, 16 << 10, 20, 64 * kMebibyte},
    {"semantic_kitti", "*.bin *.label *.folder", semantic_kitti, 64 << 10},
    {"labelled_points", "*.ply", labelled_points, 16 << 10, 11, 256 * kMebibyte},
    {"splats_ply", "*.ply", splats_ply, 16 << 10, 5, 64 * kMebibyte},
    {"dot_splat", "*.splat", dot_splat},
    {"splats_glb", "*.glb", splats_glb},
    {"scene_file", "*.folder *.ply *.npy *.npz *.vox *.sgrid *.glb *.splat", scene_file, 16 << 10, 1024,
     256 * kMebibyte},
    {"label_table", "*.json", label_table},
};

} // namespace scenes

std::span<const FuzzTarget> scene_targets()
{
    return scenes::kTargets;
}

} // namespace semrover::fuzz
