// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/asset_folder.h"

#include "runtime/base/inner_path.h"
#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace fs = std::filesystem;

namespace {

constexpr size_t kMostNames = 1 << 16; // of a folder that is looked through

std::string with_slashes(std::string_view name) // as Windows writes them
{
    std::string text(name);
    std::ranges::replace(text, '\\', '/');
    return text;
}

std::string in_small_letters(std::string text)
{
    std::ranges::transform(text, text.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? char(c + 32) : c; });
    return text;
}

// none if it is absolute, or may leave the folder
std::optional<Path> relative_path(std::string_view name)
{
    const std::string text = with_slashes(name);
    const Path relative = text;
    const bool climbs = std::ranges::find(relative, Path("..")) != relative.end();
    if (!leads_inside(text) || climbs || (text.size() > 1 && text[1] == ':'))
        return std::nullopt;
    return relative;
}

} // namespace

AssetFolder::AssetFolder(const Path& mesh_file, MissingTextures missing_textures) : missing_textures_(missing_textures)
{
    const Path parent = mesh_file.parent_path();
    folder_ = parent.empty() ? Path(".") : parent;
}

const AssetFolder::Names& AssetFolder::names_in(const Path& folder)
{
    const auto [entry, is_new] = names_.try_emplace(folder);
    std::error_code error;
    if (is_new)
        for (fs::directory_iterator i(folder, error), end; !error && i != end; i.increment(error)) {
            const std::string name = i->path().filename().string();
            const auto [at, first] = entry->second.try_emplace(in_small_letters(name), name);
            if (!first) // the same one in each run, whatever order the folder is in
                at->second = std::min(at->second, name);
            if (entry->second.size() >= kMostNames)
                break;
        }
    return entry->second;
}

std::optional<Path> AssetFolder::like(const Path& relative)
{
    std::error_code error;
    if (fs::symlink_status(folder_ / relative, error).type() != fs::file_type::not_found)
        return relative;
    Path found;
    for (const Path& part : relative) {
        if (part == "." || part.empty())
            continue;
        const Names& names = names_in(folder_ / found);
        const auto name = names.find(in_small_letters(part.string()));
        if (name == names.end())
            return std::nullopt;
        found /= name->second;
    }
    return found;
}

std::optional<Path> AssetFolder::found_for(std::string_view name)
{
    if (const auto relative = relative_path(name))
        if (const auto found = like(*relative))
            return found;
    const auto last = relative_path(Path(with_slashes(name)).filename().string());
    return last ? like(*last) : std::nullopt;
}

bool AssetFolder::has(std::string_view name)
{
    return found_for(name).has_value();
}

bool AssetFolder::missing(std::string_view name)
{
    return relative_path(name) && !found_for(name);
}

Result<Path> AssetFolder::find(std::string_view name, std::string_view where)
{
    const auto named = relative_path(name), found = found_for(name);
    if (!named && !found)
        return fail(ErrorCode::bad_input,
                    "{}: refers to {}, expected a file within its own folder; put the file beside the mesh", where,
                    quote(name));
    std::error_code error;
    const Path path = fs::canonical(folder_ / found.value_or(named.value_or(Path())), error);
    if (error)
        return fail(ErrorCode::bad_input, "{}: refers to {}, which is missing: {}", where, quote(name),
                    error.message());
    if (!lies_inside(folder_, path))
        return fail(ErrorCode::bad_input, "{}: refers to {}, which leads out of its folder", where, quote(name));
    if (found != named)
        add_warning(warnings, fmt::format("{}: refers to {}; {} is taken", where, quote(name), quote_path(*found)));
    return path;
}

Result<int32_t> AssetFolder::texture_or_white(Result<int32_t> texture)
{
    if (texture || texture.error().code != ErrorCode::bad_input)
        return texture;
    if (missing_textures_ == MissingTextures::refuse)
        return fail(ErrorCode::bad_input, "{}; `missing_textures` white goes on without", texture.error().message);
    add_warning(warnings, texture.error().message + "; it is white");
    return -1;
}

Result<int32_t> AssetFolder::texture(Mesh& mesh, std::string_view name, std::string_view where, TextureWrap wrap)
{
    const auto read = [&]() -> Result<int32_t> {
        SR_TRY(const Path path, find(name, where));
        const auto entry = textures_.find({path, wrap});
        if (entry != textures_.end())
            return entry->second;
        SR_TRY(ImageWithAlpha image, read_texture(path, budget_));
        SR_TRY(const MappedFile file, MappedFile::open(path));
        SR_TRY(std::vector<uint16_t> numbers, texture_numbers(file.bytes(), quote_path(path)));
        mesh.textures.push_back({std::move(image.color), wrap, wrap, std::move(image.alpha), std::move(numbers)});
        return textures_[{path, wrap}] = int32_t(mesh.textures.size() - 1);
    };
    return texture_or_white(read());
}

} // namespace semrover
