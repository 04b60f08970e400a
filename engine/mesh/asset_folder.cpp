// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/asset_folder.h"

#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace fs = std::filesystem;

AssetFolder::AssetFolder(const Path& mesh_file)
{
    const Path parent = mesh_file.parent_path();
    folder_ = parent.empty() ? Path(".") : parent;
}

std::optional<Path> AssetFolder::relative(std::string_view name)
{
    std::string text(name);
    std::ranges::replace(text, '\\', '/'); // as Windows writes them
    const Path relative = text;
    const bool climbs = std::ranges::find(relative, Path("..")) != relative.end();
    if (text.empty() || relative.is_absolute() || climbs || text.find('\0') != std::string::npos ||
        (text.size() > 1 && text[1] == ':'))
        return std::nullopt;
    return relative;
}

bool AssetFolder::missing(std::string_view name) const
{
    const auto path = relative(name);
    std::error_code error;
    return path && fs::symlink_status(folder_ / *path, error).type() == fs::file_type::not_found;
}

Result<Path> AssetFolder::find(std::string_view name, std::string_view where) const
{
    const auto path = relative(name);
    if (!path)
        return fail(ErrorCode::bad_input, "{}: refers to {}, expected a file within its own folder", where,
                    quote(name));
    std::error_code error;
    const Path found = fs::canonical(folder_ / *path, error);
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
    SR_TRY(const Path path, find(name, where));
    const auto entry = textures_.find({path, wrap});
    if (entry != textures_.end())
        return entry->second;
    SR_TRY(ImageRgb8 image, read_texture_rgb8(path, budget_));
    SR_TRY(const MappedFile file, MappedFile::open(path));
    SR_TRY(std::vector<uint16_t> numbers, texture_numbers(file.bytes(), quote_path(path)));
    mesh.textures.push_back({std::move(image), wrap, wrap, std::move(numbers)});
    return textures_[{path, wrap}] = int32_t(mesh.textures.size() - 1);
}

} // namespace semrover
