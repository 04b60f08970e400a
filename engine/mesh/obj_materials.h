// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/asset_folder.h"
#include "engine/mesh/word_lines.h"

#include <map>
#include <set>

namespace semrover {

// The materials of an OBJ: those that it names, and what its .mtl files say of them
class ObjMaterials {
  public:
    ObjMaterials(const Path& obj, Mesh& mesh, const MeshReadOptions& options)
        : obj_(quote_path(obj)), mesh_(mesh), folder_(obj, options.missing_textures)
    {
    }

    // index into Mesh::materials of a name, added where it is new
    Result<uint32_t> add(const std::string& name);
    // what follows `mtllib`: one name, or several with blanks between; a backslash in front of a blank makes it part
    // of a name. Missing files give a warning
    Status read_libraries(std::string_view names, size_t line);
    // once all faces are there: where -s and -o of their textures put them
    void place_textures();

  private:
    enum class Map { color, alpha };
    struct Mapping { // of texture coordinates, in the file's axes
        std::array<double, 2> scale = {1, 1}, offset = {0, 0};
        bool operator==(const Mapping&) const = default;
    };
    struct MapOptions {
        Mapping mapping;
        TextureWrap wrap = TextureWrap::repeat;
        char channel = 0; // of -imfchan
    };
    struct Seen { // of a material while its file is read
        std::optional<Mapping> color, alpha;
        std::optional<double> dissolve, transparency;
        std::string color_name, alpha_name;
        bool in_file = false;
    };
    std::vector<std::string> library_names(std::string_view text);
    Status read_library(std::string_view name, std::string_view where);
    Status read_line(const WordLines& lines, const std::string& where, int64_t& current);
    Status read_color(const WordLines& lines, const std::string& where, Material& material);
    Result<size_t> read_options(const WordLines& lines, const std::string& where, MapOptions& options);
    Result<size_t> read_option(const WordLines& lines, size_t at, const std::string& where, MapOptions& options);
    Status read_map(Map map, const WordLines& lines, const std::string& where, size_t material);
    Status take_alpha(size_t texture, char channel, bool alone, std::string_view where);
    void settle_alpha(std::string_view where);

    std::string obj_;
    Mesh& mesh_;
    AssetFolder folder_;
    std::map<std::string, uint32_t> numbers_;
    std::vector<Seen> seen_;          // of materials
    std::map<size_t, char> channels_; // that alpha of textures was taken from
    std::set<Path> files_;            // each is read once
    size_t libraries_ = 0;
};

} // namespace semrover
