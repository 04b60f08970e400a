// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/asset_folder.h"

#include "engine/mesh/texture_image.h"
#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace fs = std::filesystem;

AssetFolder::AssetFolder(const Path& mesh_file)
{
    const Path parent = mesh_file.parent_path();
    folder_ = parent.empty() ? Path(".") : parent;
}

Result<Path> AssetFolder::find(std::string_view name, std::string_view where) const
{
    std::string text(name);
    std::ranges::replace(text, '\\', '/'); // as Windows writes them
    const Path relative = text;
    const bool climbs = std::ranges::find(relative, Path("..")) != relative.end();
    if (text.empty() || relative.is_absolute() || climbs || text.find('\0') != std::string::npos ||
        (text.size() > 1 && text[1] == ':'))
        return fail(ErrorCode::bad_input, "{}: refers to {}, expected a file within its own folder", where,
                    quote(name));
    std::error_code error;
    const Path found = fs::canonical(folder_ / relative, error);
    if (error)
        return fail(ErrorCode::bad_input, "{}: refers to {}, which is missing: {}", where, quote(name),
                    error.message());
    const Path folder = fs::canonical(folder_, error);
    if (error || std::ranges::mismatch(folder, found).in1 != folder.end())
        return fail(ErrorCode::bad_input, "{}: refers to {}, which leads out of its folder", where, quote(name));
    return found;
}

Result<int32_t> AssetFolder::texture(Mesh& mesh, std::string_view name, std::string_view where, TextureWrap wrap)
{
    const auto [entry, is_new] = textures_.try_emplace({std::string(name), wrap}, int32_t(mesh.textures.size()));
    if (!is_new)
        return entry->second;
    SR_TRY(const Path path, find(name, where));
    SR_TRY(ImageRgb8 image, read_texture_rgb8(path));
    mesh.textures.push_back({std::move(image), wrap, wrap});
    SR_CHECK(check_texture_budget(mesh, where));
    return entry->second;
}

Status check_texture_budget(const Mesh& mesh, std::string_view where)
{
    uint64_t pixels = 0;
    for (const Texture& t : mesh.textures)
        pixels += uint64_t(t.image.width) * t.image.height;
    if (pixels > 1u << 30)
        return fail(ErrorCode::bad_input, "{}: the textures have {} pixels, at most 2^30 are supported", where, pixels);
    return {};
}

} // namespace semrover
