// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/mesh_files.h"
#include "engine/mesh/texture_image.h"
#include "tests/fuzz/fuzz_target.h"

namespace semrover::fuzz {

namespace meshes {

void check(const Path& path)
{
    const auto read = read_mesh(path);
    if (accepts(read))
        if (const Status status = check_mesh(*read, "mesh"); !status)
            found("read_mesh gives what is none: " + status.error().message);
}

void obj(Bytes input)
{
    const InputFolder folder(input, "m.obj");
    check(folder.path() / "m.obj");
}

void gltf(Bytes input)
{
    const InputFolder folder(input, "m.gltf");
    check(folder.path() / "m.gltf");
}

void glb(Bytes input)
{
    check(InputFile(input, "m.glb"));
}

void stl(Bytes input)
{
    check(InputFile(input, "m.stl"));
}

void off(Bytes input)
{
    check(InputFile(input, "m.off"));
}

void ply_mesh(Bytes input)
{
    check(InputFile(input, "m.ply"));
}

void mesh_folder(Bytes input)
{
    const InputFolder folder(input, "m.obj");
    check(folder.first());
}

void texture(Bytes input)
{
    for (const char* name : {"t.png", "t.tga"}) {
        TextureBudget budget;
        (void)accepts(read_texture(InputFile(input, name), budget));
    }
    (void)accepts(texture_numbers(input, "t.png"));
}

constexpr FuzzTarget kTargets[] = {
    {"obj", "*.obj *.mtl", obj, 16 << 10, 64, 64 * kMebibyte},
    {"gltf", "*.gltf", gltf, 16 << 10, 256, 192 * kMebibyte},
    {"glb", "*.glb", glb, 16 << 10, 256, 192 * kMebibyte},
    {"stl", "*.stl", stl, 16 << 10, 64, 64 * kMebibyte},
    {"off", "*.off", off, 16 << 10, 64, 64 * kMebibyte},
    {"ply_mesh", "*.ply", ply_mesh, 16 << 10, 64, 64 * kMebibyte},
    {"mesh_folder", "*.folder", mesh_folder, 64 << 10, 256, 192 * kMebibyte},
    {"texture", "*.png *.jpg *.tga *.bmp *.hdr", texture, 8 << 10, 5 * 1032, 400 * kMebibyte},
};

} // namespace meshes

std::span<const FuzzTarget> mesh_targets()
{
    return meshes::kTargets;
}

} // namespace semrover::fuzz
