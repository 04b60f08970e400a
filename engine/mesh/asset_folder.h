// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/mesh.h"
#include "engine/mesh/texture_image.h"
#include "runtime/base/file.h"

#include <map>
#include <optional>

namespace semrover {

// The folder of a mesh file. References to other files must stay inside it.
class AssetFolder {
  public:
    explicit AssetFolder(const Path& mesh_file);

    // bad_input, with `where` in front, for absolute names, names that leave the folder (also through links), and
    // files that are missing
    Result<Path> find(std::string_view name, std::string_view where) const;

    // whether it names a place inside the folder where no file is; false also for names that find() refuses
    bool missing(std::string_view name) const;

    // index of a texture in the mesh, decoded once for each file and pair of wraps; mesh files repeat them
    Result<int32_t> texture(Mesh& mesh, std::string_view name, std::string_view where,
                            TextureWrap wrap = TextureWrap::repeat);

  private:
    static std::optional<Path> relative(std::string_view name); // none if it is absolute, or may leave the folder

    Path folder_;
    std::map<std::pair<Path, TextureWrap>, int32_t> textures_; // by where links lead
    TextureBudget budget_;
};

} // namespace semrover
