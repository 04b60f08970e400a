// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// Wavefront OBJ: vertices with or without colours, polygons, names of materials
#include "engine/mesh/mesh_readers.h"
#include "engine/mesh/obj_materials.h"
#include "engine/mesh/word_lines.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <charconv>

namespace semrover {

namespace {

constexpr uint64_t kMaxObjBytes = 8ull << 30;

class ObjReader {
  public:
    ObjReader(const Path& path, const MeshReadOptions& options)
        : where_(quote_path(path)), materials_(path, mesh_, options)
    {
    }

    Result<FileMesh> read(std::string_view text);

  private:
    struct Corner {
        size_t vertex;
        int64_t uv; // -1: none
    };
    Status read_line();
    Status read_vertex();
    Status read_face();
    Result<Corner> corner_of(std::string_view word);
    Result<int64_t> index_of(std::string_view word, size_t count, const char* what);
    Status use_material();
    Status read_texture_coordinate();

    std::string where_;
    WordLines lines_{{}};
    Mesh mesh_;
    ObjMaterials materials_;
    std::vector<std::array<double, 3>> positions_;
    std::vector<std::array<float, 2>> uvs_;
    int64_t material_ = -1;
    size_t uv_less_line_ = 0; // the first face that names texture coordinates before there are any
    bool any_material_ = false, any_uv_ = false;
};

// x y z [w], x y z r g b or x y z r g b a: seven numbers are what MeshLab, tinyobjloader and three.js take them for
Status ObjReader::read_vertex()
{
    const size_t n = lines_.words.size() - 1;
    if (n != 3 && n != 4 && n != 6 && n != 7)
        return fail(ErrorCode::bad_input, "{}: line {}: a vertex of {} numbers, expected 3, or 6 with a colour", where_,
                    lines_.number, n);
    std::array<double, 7> values{};
    for (size_t i = 0; i < n; ++i) {
        SR_TRY(values[i], number_of(lines_.words[i + 1], where_, lines_.number));
    }
    positions_.push_back({values[0], values[1], values[2]});
    if (n == 4 && values[3] != 1)
        add_warning(mesh_.warnings, fmt::format("{}: vertices have weights other than 1, which are ignored", where_));
    if (n >= 6) {
        mesh_.colors.resize(positions_.size() - 1, {255, 255, 255});
        std::array<uint8_t, 3> color;
        for (size_t a = 0; a < 3; ++a) {
            const auto c = float(values[3 + a]);
            if (!(c >= 0 && c <= 1))
                return fail(ErrorCode::bad_input, "{}: line {}: a vertex has the colour {}, expected 0 to 1", where_,
                            lines_.number, c);
            color[a] = uint8_t(std::lround(c * 255));
        }
        mesh_.colors.push_back(color);
    }
    return {};
}

// from 1, or back from the last one
Result<int64_t> ObjReader::index_of(std::string_view word, size_t count, const char* what)
{
    int64_t value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size())
        return fail(ErrorCode::bad_input, "{}: line {}: expected the number of a {}, found {}", where_, lines_.number,
                    what, quote(word, 40));
    const int64_t index = value < 0 ? int64_t(count) + value : value - 1;
    if (value == 0 || index < 0 || index >= int64_t(count))
        return fail(ErrorCode::bad_input, "{}: line {}: refers to {} {}, there are {} so far", where_, lines_.number,
                    what, value, count);
    return index;
}

// v, v/vt, v//vn or v/vt/vn
Result<ObjReader::Corner> ObjReader::corner_of(std::string_view word)
{
    const size_t slash = std::min(word.find('/'), word.size());
    SR_TRY(const int64_t vertex, index_of(word.substr(0, slash), positions_.size(), "vertex"));
    Corner corner{size_t(vertex), -1};
    if (slash < word.size()) {
        const std::string_view after = word.substr(slash + 1);
        const std::string_view uv = after.substr(0, after.find('/'));
        if (!uv.empty() && uvs_.empty()) { // exporters write f 1/1/1 whether there are any or not
            uv_less_line_ = uv_less_line_ ? uv_less_line_ : lines_.number;
        } else if (!uv.empty()) {
            SR_TRY(corner.uv, index_of(uv, uvs_.size(), "texture coordinate"));
        }
    }
    return corner;
}

Status ObjReader::read_face()
{
    if (lines_.words.size() < 4)
        return fail(ErrorCode::bad_input, "{}: line {}: a face of {} corners, expected 3 or more", where_,
                    lines_.number, lines_.words.size() - 1);
    if (lines_.words.size() - 1 > kMaxFaceCorners)
        return fail(ErrorCode::bad_input, "{}: line {}: a face of more than {} corners, which is not supported", where_,
                    lines_.number, kMaxFaceCorners);
    std::vector<Corner> corners;
    std::vector<std::array<double, 3>> positions;
    for (size_t i = 1; i < lines_.words.size(); ++i) {
        SR_TRY(const Corner corner, corner_of(lines_.words[i]));
        corners.push_back(corner);
        positions.push_back(positions_[corner.vertex]);
    }
    for (const auto& t : triangulated(positions)) {
        std::array<uint32_t, 3> face;
        std::array<std::array<float, 2>, 3> uv{};
        for (size_t k = 0; k < 3; ++k) {
            face[k] = uint32_t(corners[t[k]].vertex);
            if (corners[t[k]].uv >= 0)
                uv[k] = uvs_[size_t(corners[t[k]].uv)];
        }
        mesh_.faces.push_back(face);
        mesh_.uvs.push_back(uv);
        mesh_.face_materials.push_back(uint32_t(std::max<int64_t>(material_, 0)));
        any_uv_ = any_uv_ || corners[t[0]].uv >= 0;
    }
    if (mesh_.faces.size() > kMaxMeshElements || positions_.size() > kMaxMeshElements)
        return fail(ErrorCode::bad_input, "{}: line {}: more than {} faces or vertices", where_, lines_.number,
                    kMaxMeshElements);
    return {};
}

Status ObjReader::use_material()
{
    if (material_ < 0 && !mesh_.faces.empty() && !any_material_) { // faces before the first usemtl have none
        SR_TRY(const uint32_t none, materials_.add(""));
        std::ranges::fill(mesh_.face_materials, none);
    }
    SR_TRY(const uint32_t index, materials_.add(std::string(lines_.rest(1))));
    material_ = index;
    any_material_ = true;
    return {};
}

Status ObjReader::read_texture_coordinate()
{
    if (uv_less_line_)
        return fail(ErrorCode::bad_input, "{}: line {}: a texture coordinate behind the face of line {} that names it",
                    where_, lines_.number, uv_less_line_);
    if (lines_.words.size() < 2 || lines_.words.size() > 4)
        return fail(ErrorCode::bad_input, "{}: line {}: a texture coordinate of {} numbers, expected 2", where_,
                    lines_.number, lines_.words.size() - 1);
    std::array<float, 2> uv{};
    for (size_t i = 0; i + 1 < std::min<size_t>(lines_.words.size(), 3); ++i) {
        SR_TRY(const double number, number_of(lines_.words[i + 1], where_, lines_.number));
        uv[i] = float(number);
    }
    uvs_.push_back({uv[0], 1 - uv[1]}); // v runs up in these files
    return {};
}

Status ObjReader::read_line()
{
    const std::string_view key = lines_.words[0];
    if (key == "v")
        return read_vertex();
    if (key == "f")
        return read_face();
    if (key == "usemtl")
        return use_material();
    if (key == "mtllib")
        return materials_.read_libraries(lines_.rest(1), lines_.number);
    return key == "vt" ? read_texture_coordinate() : Status(); // normals, groups, lines and the like are not used
}

Result<FileMesh> ObjReader::read(std::string_view text)
{
    lines_ = WordLines(text);
    while (lines_.next())
        if (!lines_.words.empty())
            SR_CHECK(read_line());
    if (!mesh_.colors.empty())
        mesh_.colors.resize(positions_.size(), {255, 255, 255});
    if (!mesh_.textures.empty())
        mesh_.colors.clear();
    if (uv_less_line_)
        add_warning(mesh_.warnings, fmt::format("{}: line {}: faces name texture coordinates, the file has none",
                                                where_, uv_less_line_));
    if (!any_uv_)
        mesh_.uvs.clear();
    if (!any_material_)
        mesh_.face_materials.clear();
    materials_.place_textures();
    return FileMesh{std::move(mesh_), std::move(positions_)};
}

} // namespace

Result<FileMesh> read_obj(const Path& path, const MeshReadOptions& options)
{
    SR_TRY(const std::string text, read_text_file(path, kMaxObjBytes));
    return ObjReader(path, options).read(text);
}

} // namespace semrover
