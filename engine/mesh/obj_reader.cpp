// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// Wavefront OBJ and MTL: vertices with or without colours, polygons, materials with a colour and a texture
#include "engine/mesh/asset_folder.h"
#include "engine/mesh/mesh_readers.h"
#include "engine/mesh/polygon.h"
#include "engine/mesh/word_lines.h"
#include "engine/scene/srgb.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <charconv>
#include <map>
#include <set>

namespace semrover {

namespace {

constexpr uint64_t kMaxObjBytes = 8ull << 30, kMaxMtlBytes = 16u << 20;
constexpr size_t kMaxMaterials = 1 << 16;

class ObjReader {
  public:
    explicit ObjReader(const Path& path) : where_(quote_path(path)), folder_(path) {}

    Result<Mesh> read(std::string_view text);

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
    Status read_materials(std::string_view name);
    Status read_material_line(WordLines& lines, const std::string& where, int64_t& current);
    Result<uint32_t> add_material(const std::string& name);
    Status read_texture(const WordLines& lines, const std::string& where, Material& material);

    std::string where_;
    AssetFolder folder_;
    WordLines lines_{{}};
    Mesh mesh_;
    std::vector<std::array<float, 2>> uvs_;
    std::map<std::string, uint32_t> materials_;
    std::set<Path> material_files_; // each is read once
    int64_t material_ = -1;
    size_t uv_less_line_ = 0; // the first face that names texture coordinates before there are any
    bool any_material_ = false, any_uv_ = false;
};

Status ObjReader::read_vertex()
{
    const size_t n = lines_.words.size() - 1;
    if (n != 3 && n != 4 && n != 6 && n != 7)
        return fail(ErrorCode::bad_input, "{}: line {}: a vertex of {} numbers, expected 3, or 6 with a colour", where_,
                    lines_.number, n);
    std::array<float, 7> values{};
    for (size_t i = 0; i < n; ++i) {
        SR_TRY(values[i], number_of(lines_.words[i + 1], where_, lines_.number));
    }
    mesh_.positions.push_back({values[0], values[1], values[2]});
    if (n >= 6) {
        mesh_.colors.resize(mesh_.positions.size() - 1, {255, 255, 255});
        std::array<uint8_t, 3> color;
        for (size_t a = 0; a < 3; ++a) {
            const float c = values[n - 3 + a];
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
    SR_TRY(const int64_t vertex, index_of(word.substr(0, slash), mesh_.positions.size(), "vertex"));
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
    std::vector<std::array<float, 3>> positions;
    for (size_t i = 1; i < lines_.words.size(); ++i) {
        SR_TRY(const Corner corner, corner_of(lines_.words[i]));
        corners.push_back(corner);
        positions.push_back(mesh_.positions[corner.vertex]);
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
    if (mesh_.faces.size() > kMaxMeshElements || mesh_.positions.size() > kMaxMeshElements)
        return fail(ErrorCode::bad_input, "{}: line {}: more than {} faces or vertices", where_, lines_.number,
                    kMaxMeshElements);
    return {};
}

Result<uint32_t> ObjReader::add_material(const std::string& name)
{
    const auto [entry, is_new] = materials_.try_emplace(name, uint32_t(mesh_.materials.size()));
    if (is_new && mesh_.materials.size() >= kMaxMaterials)
        return fail(ErrorCode::bad_input, "{}: more than {} materials", where_, kMaxMaterials);
    if (is_new)
        mesh_.materials.push_back({.name = name});
    return entry->second;
}

Status ObjReader::use_material()
{
    if (material_ < 0 && !mesh_.faces.empty() && !any_material_) { // faces before the first usemtl have none
        SR_TRY(const uint32_t none, add_material(""));
        std::ranges::fill(mesh_.face_materials, none);
    }
    SR_TRY(const uint32_t index, add_material(std::string(lines_.rest(1))));
    material_ = index;
    any_material_ = true;
    return {};
}

// map_Kd [-option values]... file; options are a word and the numbers or on/off that follow
Status ObjReader::read_texture(const WordLines& lines, const std::string& where, Material& material)
{
    size_t at = 1;
    TextureWrap wrap = TextureWrap::repeat;
    const auto is_value = [](std::string_view w) {
        return w == "on" || w == "off" || w.find_first_not_of("+-.0123456789eE") == std::string_view::npos;
    };
    while (at + 1 < lines.words.size() && lines.words[at].starts_with('-')) {
        const std::string_view option = lines.words[at++];
        if (option == "-clamp" && lines.words[at] == "on")
            wrap = TextureWrap::clamp;
        if (option == "-type" || option == "-imfchan")
            ++at;
        while (at + 1 < lines.words.size() && is_value(lines.words[at]))
            ++at;
    }
    SR_TRY(material.texture, folder_.texture(mesh_, lines.rest(at), where, wrap));
    return {};
}

Status ObjReader::read_material_line(WordLines& lines, const std::string& where, int64_t& current)
{
    const std::string_view key = lines.words[0];
    if (key == "newmtl") {
        SR_TRY(current, add_material(std::string(lines.rest(1))));
        return {};
    }
    if (key != "Kd" && key != "map_Kd")
        return {};
    if (current < 0)
        return fail(ErrorCode::bad_input, "{}: line {}: {} in front of the first newmtl", where, lines.number, key);
    Material& material = mesh_.materials[size_t(current)];
    if (key == "map_Kd")
        return read_texture(lines, fmt::format("{}: line {}", where, lines.number), material);
    if (lines.words.size() != 2 && lines.words.size() != 4)
        return fail(ErrorCode::bad_input, "{}: line {}: Kd with {} numbers, expected 3", where, lines.number,
                    lines.words.size() - 1);
    for (size_t a = 0; a < 3; ++a) { // as programs write it: what a picture shows, that is sRGB
        SR_TRY(const float value, number_of(lines.words[std::min(a + 1, lines.words.size() - 1)], where, lines.number));
        if (!(value >= 0 && value <= 1))
            return fail(ErrorCode::bad_input, "{}: line {}: the colour {}, expected 0 to 1", where, lines.number,
                        value);
        material.color[a] = float(linear_of_srgb(value));
    }
    return {};
}

Status ObjReader::read_materials(std::string_view name)
{
    const auto missing = folder_.missing(name);
    if (missing) { // names of materials are in the OBJ itself; colours and textures are not
        if (mesh_.warnings.size() < 10)
            mesh_.warnings.push_back(
                fmt::format("{}: line {}: {} is missing: its materials are white", where_, lines_.number, quote(name)));
        return {};
    }
    SR_TRY(const Path path, folder_.find(name, fmt::format("{}: line {}", where_, lines_.number)));
    if (!material_files_.insert(path).second)
        return {};
    const std::string where = quote_path(path);
    SR_TRY(const std::string text, read_text_file(path, kMaxMtlBytes));
    WordLines lines(text);
    int64_t current = -1;
    while (lines.next())
        if (!lines.words.empty())
            SR_CHECK(read_material_line(lines, where, current));
    for (Material& m : mesh_.materials)
        if (m.texture >= 0 && m.color == std::array<float, 3>{0, 0, 0})
            m.color = {1, 1, 1}; // exporters leave Kd black beside a texture
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
        SR_TRY(uv[i], number_of(lines_.words[i + 1], where_, lines_.number));
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
    if (key == "mtllib") {
        if (lines_.words.size() < 2)
            return fail(ErrorCode::bad_input, "{}: line {}: mtllib without a name", where_, lines_.number);
        return read_materials(lines_.rest(1));
    }
    return key == "vt" ? read_texture_coordinate() : Status(); // normals, groups, lines and the like are not used
}

Result<Mesh> ObjReader::read(std::string_view text)
{
    lines_ = WordLines(text);
    while (lines_.next())
        if (!lines_.words.empty())
            SR_CHECK(read_line());
    if (!mesh_.colors.empty())
        mesh_.colors.resize(mesh_.positions.size(), {255, 255, 255});
    if (!mesh_.textures.empty())
        mesh_.colors.clear();
    if (uv_less_line_)
        mesh_.warnings.push_back(
            fmt::format("{}: line {}: faces name texture coordinates, the file has none", where_, uv_less_line_));
    if (!any_uv_)
        mesh_.uvs.clear();
    if (!any_material_)
        mesh_.face_materials.clear();
    return std::move(mesh_);
}

} // namespace

Result<Mesh> read_obj(const Path& path)
{
    SR_TRY(const std::string text, read_text_file(path, kMaxObjBytes));
    return ObjReader(path).read(text);
}

} // namespace semrover
