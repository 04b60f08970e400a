// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/mesh_files.h"
#include "engine/mesh/texture_image.h"

#include <map>
#include <optional>

namespace semrover {

// The folder of a mesh file. References to other files must stay inside it.
class AssetFolder {
  public:
    explicit AssetFolder(const Path& mesh_file, MissingTextures missing_textures = MissingTextures::refuse);

    // Where a reference leads: the file of that name; else one whose name differs in case only; else, as files are
    // copied without their folders, the one of its last name beside the mesh. The latter two with a warning.
    // bad_input, with `where` in front, for names that leave the folder (also through links), and files that are
    // missing
    Result<Path> find(std::string_view name, std::string_view where);

    // whether find() leads to a file that is there
    bool has(std::string_view name);
    // whether it names a place inside the folder where no file is; false also for names that find() refuses
    bool missing(std::string_view name);

    // index of a texture in the mesh, decoded once for each file and pair of wraps; mesh files repeat them. -1 for one
    // that is missing or cannot be read, where MissingTextures allow it
    Result<int32_t> texture(Mesh& mesh, std::string_view name, std::string_view where,
                            TextureWrap wrap = TextureWrap::repeat);
    // index of one that was read, or -1 for an error that MissingTextures turn into a warning
    Result<int32_t> texture_or_white(Result<int32_t> texture);

    std::vector<std::string> warnings;

  private:
    using Names = std::map<std::string, std::string>; // of a folder's entries, by the name in small letters
    std::optional<Path> like(const Path& relative);   // the same but for case; none if there is nothing
    std::optional<Path> found_for(std::string_view name);
    const Names& names_in(const Path& folder);

    Path folder_;
    MissingTextures missing_textures_;
    std::map<Path, Names> names_;
    std::map<std::pair<Path, TextureWrap>, int32_t> textures_; // by where links lead
    TextureBudget budget_;
};

} // namespace semrover
