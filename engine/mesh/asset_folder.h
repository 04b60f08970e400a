// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/mesh.h"
#include "runtime/base/file.h"

#include <map>

namespace semrover {

// The folder of a mesh file. References to other files must stay inside it.
class AssetFolder {
  public:
    explicit AssetFolder(const Path& mesh_file);

    // bad_input, with `where` in front, for absolute names, names that leave the folder (also through links), and
    // files that are missing
    Result<Path> find(std::string_view name, std::string_view where) const;

    // index of a texture in the mesh, decoded once for each name and pair of wraps; mesh files repeat them
    Result<int32_t> texture(Mesh& mesh, std::string_view name, std::string_view where,
                            TextureWrap wrap = TextureWrap::repeat);

  private:
    Path folder_;
    std::map<std::pair<std::string, TextureWrap>, int32_t> textures_;
};

// bad_input if all textures together have more than 2^30 pixels: files of a few bytes can hold large images
Status check_texture_budget(const Mesh& mesh, std::string_view where);

} // namespace semrover
