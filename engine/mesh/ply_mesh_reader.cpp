// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// PLY meshes as MeshLab, CloudCompare, Open3D and OpenMVS write them
#include "engine/format/file_colors.h"
#include "engine/format/label_map.h"
#include "engine/mesh/asset_folder.h"
#include "engine/mesh/mesh_readers.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace semrover {

namespace {

using Column = const PlyProperty*;

constexpr int64_t kNoNumber = INT64_MIN; // in a column of labels
constexpr size_t kMostNumbers = 4096;    // that are counted

class PlyMesh {
  public:
    PlyMesh(const Path& path, const PlyFile& file, const MeshReadOptions& options)
        : where_(quote_path(path)), file_(file), map_(options.map), wants_labels_(options.labels),
          folder_(path, options.missing_textures)
    {
    }

    Result<FileMesh> read();

  private:
    static Column first(const PlyElement& e, std::initializer_list<std::string_view> names, bool list);
    Status read_vertices(const PlyElement& vertices);
    Status read_colors(const PlyElement& vertices);
    Status read_faces(const PlyElement& vertices, const PlyElement& faces);
    Status read_textures();
    Status read_face(size_t row);
    Status read_labels(const PlyElement& vertices, const PlyElement& faces);
    std::vector<uint8_t> labels_in(const PlyProperty& column, bool foreign);
    uint8_t label_of_corners(uint64_t begin, uint64_t count) const;
    Status check_labels(const LabelColumn& column, bool ours);

    std::string where_;
    const PlyFile& file_;
    const MeshLabelMap& map_;
    bool wants_labels_;
    AssetFolder folder_;
    Mesh mesh_;
    std::vector<std::array<double, 3>> positions_;
    std::vector<uint8_t> face_labels_, vertex_labels_; // of the file's polygons, or of its vertices
    Column indices_ = nullptr, labels_ = nullptr, texcoord_ = nullptr, texnumber_ = nullptr, u_ = nullptr, v_ = nullptr;
    std::map<int64_t, size_t> numbers_; // in the column of labels, and how many rows have them
    bool of_vertices_ = false, known_ = true;
};

Column PlyMesh::first(const PlyElement& e, std::initializer_list<std::string_view> names, bool list)
{
    for (const std::string_view name : names)
        if (const PlyProperty* p = e.find(name); p && p->is_list == list)
            return p;
    return nullptr;
}

Status PlyMesh::read_vertices(const PlyElement& vertices)
{
    const Column axes[3] = {first(vertices, {"x"}, false), first(vertices, {"y"}, false),
                            first(vertices, {"z"}, false)};
    if (!axes[0] || !axes[1] || !axes[2])
        return fail(ErrorCode::bad_input, "{}: the vertices have no x, y and z", where_);
    positions_.resize(vertices.rows);
    for (size_t i = 0; i < vertices.rows; ++i)
        for (size_t a = 0; a < 3; ++a)
            positions_[i][a] = axes[a]->values[i];
    return {};
}

Status PlyMesh::read_colors(const PlyElement& vertices)
{
    if (!mesh_.textures.empty())
        return {};
    SR_TRY(const std::optional<PlyColors> colors, PlyColors::find(vertices, where_, mesh_.warnings));
    for (size_t i = 0; colors && i < vertices.rows; ++i)
        mesh_.colors.push_back(colors->bytes(i));
    return {};
}

// without blanks around it
std::string trimmed(const std::string& text)
{
    const size_t begin = text.find_first_not_of(" \t"), end = text.find_last_not_of(" \t");
    return begin == std::string::npos ? "" : text.substr(begin, end + 1 - begin);
}

// `comment TextureFile NAME`, one for each number that texnumber can have; MeshLab writes blanks around the name
Status PlyMesh::read_textures()
{
    constexpr std::string_view kKey = "TextureFile ";
    for (const std::string& comment : file_.comments) {
        if (!comment.starts_with(kKey))
            continue;
        if (mesh_.materials.size() >= 4096)
            return fail(ErrorCode::bad_input, "{}: more than 4096 textures", where_);
        SR_TRY(const int32_t texture, folder_.texture(mesh_, trimmed(comment.substr(kKey.size())), where_));
        mesh_.materials.push_back({.name = "", .texture = texture});
    }
    return {};
}

// and counts them
std::vector<uint8_t> PlyMesh::labels_in(const PlyProperty& column, bool foreign)
{
    std::vector<uint8_t> labels;
    for (size_t row = 0; row < column.values.size(); ++row) {
        const double value = column.values[row];
        const bool whole = std::abs(value) < 4e9 && value == std::round(value);
        const int64_t number = whole ? std::llround(value) : kNoNumber;
        const auto label = map_.find(number, foreign);
        known_ = known_ && label;
        if (numbers_.size() < kMostNumbers || numbers_.contains(number))
            ++numbers_[number];
        labels.push_back(label.value_or(kNoLabel));
    }
    return labels;
}

// what LabelMap says of numbers that are not ours or not known
Status PlyMesh::check_labels(const LabelColumn& column, bool ours)
{
    const char* things = of_vertices_ ? "vertices" : "faces";
    if (numbers_.contains(kNoNumber))
        return fail(ErrorCode::bad_input, "{}: {}: {} {} have something else than whole numbers", where_,
                    quote(column.name, 60), numbers_[kNoNumber], things);
    if (!map_.empty() && known_)
        return {};
    SR_TRY(LabelMap labels, LabelMap::of_column(column, ours, {}));
    std::string unknown;
    for (const auto& [number, count] : numbers_) {
        if (number >= 0 && number != kNoLabel)
            labels(uint32_t(number), count);
        if (!map_.find(number, !ours && !column.table.empty()) && unknown.size() < 400)
            unknown += fmt::format("{}{} ({} {})", unknown.empty() ? "" : ", ", number, count, things);
    }
    if (!map_.empty() || (!known_ && numbers_.begin()->first < 0 && column.table.empty()))
        return fail(ErrorCode::bad_input, "{}: {}: unknown labels, which {} does not say: {}; `map` says what they are",
                    where_, quote(column.name, 60), map_.empty() ? "the file" : "the map", unknown);
    SR_CHECK(labels.check(where_, things));
    for (std::string& line : labels.assumed(where_, things))
        add_warning(mesh_.warnings, std::move(line));
    return {};
}

// of faces, else of vertices
Status PlyMesh::read_labels(const PlyElement& vertices, const PlyElement& faces)
{
    if (!wants_labels_)
        return {};
    const bool ours = says_own_labels(file_.comments);
    for (const PlyElement* element : {&faces, &vertices})
        for (const LabelColumn& column : label_columns()) {
            labels_ = first(*element, {column.name}, false);
            if (!labels_)
                continue;
            of_vertices_ = element == &vertices;
            (of_vertices_ ? vertex_labels_ : face_labels_) = labels_in(*labels_, !ours && !column.table.empty());
            return check_labels(column, ours);
        }
    return {};
}

// that most corners have; ties go to a class, and to the lower one
uint8_t PlyMesh::label_of_corners(uint64_t begin, uint64_t count) const
{
    std::array<uint32_t, 256> votes{};
    for (uint64_t i = begin; i < begin + count; ++i)
        ++votes[vertex_labels_[size_t(indices_->values[i])]];
    return uint8_t(std::ranges::max_element(votes) - votes.begin());
}

Status PlyMesh::read_face(size_t row)
{
    const uint64_t begin = indices_->starts[row], count = indices_->starts[row + 1] - begin;
    if (count < 3)
        return fail(ErrorCode::bad_input, "{}: face {} has {} corners, expected 3 or more", where_, row, count);
    if (count > kMaxFaceCorners)
        return fail(ErrorCode::bad_input, "{}: face {} has {} corners, at most {} are supported", where_, row, count,
                    kMaxFaceCorners);
    std::vector<std::array<double, 3>> corners;
    for (uint64_t i = begin; i < begin + count; ++i) {
        const double index = indices_->values[i];
        if (!(index >= 0 && index < double(positions_.size())))
            return fail(ErrorCode::bad_input, "{}: face {} refers to vertex {}, the mesh has {}", where_, row, index,
                        positions_.size());
        corners.push_back(positions_[size_t(index)]);
    }
    const uint64_t uv_begin = texcoord_ ? texcoord_->starts[row] : 0;
    const uint64_t uv_count = texcoord_ ? texcoord_->starts[row + 1] - uv_begin : 0;
    if (uv_count != 0 && uv_count != 2 * count)
        return fail(ErrorCode::bad_input, "{}: face {} has {} texture coordinates for {} corners", where_, row,
                    uv_count, count);
    double number = texnumber_ ? texnumber_->values[row] : 0;
    if (!mesh_.materials.empty() && !(number >= 0 && number < double(mesh_.materials.size())))
        return fail(ErrorCode::bad_input, "{}: face {} refers to texture {}, the file names {}", where_, row, number,
                    mesh_.materials.size());
    uint8_t label = kNoLabel;
    if (labels_)
        label = of_vertices_ ? label_of_corners(begin, count) : face_labels_[row];
    for (const auto& t : triangulated(corners)) {
        std::array<uint32_t, 3> face;
        std::array<std::array<float, 2>, 3> uv{};
        for (size_t k = 0; k < 3; ++k) {
            face[k] = uint32_t(indices_->values[begin + t[k]]);
            if (uv_count) // v runs up in these files
                uv[k] = {float(texcoord_->values[uv_begin + 2 * t[k]]),
                         float(1 - texcoord_->values[uv_begin + 2 * t[k] + 1])};
            else if (u_)
                uv[k] = {float(u_->values[face[k]]), float(1 - v_->values[face[k]])};
        }
        mesh_.faces.push_back(face);
        if (labels_)
            mesh_.face_labels.push_back(label);
        if (!mesh_.materials.empty()) {
            mesh_.uvs.push_back(uv);
            mesh_.face_materials.push_back(uint32_t(number));
        }
    }
    return {};
}

Status PlyMesh::read_faces(const PlyElement& vertices, const PlyElement& faces)
{
    indices_ = first(faces, {"vertex_indices", "vertex_index"}, true);
    if (!indices_)
        return fail(ErrorCode::bad_input, "{}: the faces have no list vertex_indices", where_);
    SR_CHECK(read_labels(vertices, faces));
    texcoord_ = first(faces, {"texcoord"}, true);
    texnumber_ = first(faces, {"texnumber"}, false);
    u_ = first(vertices, {"s", "u", "texture_u"}, false);
    v_ = first(vertices, {"t", "v", "texture_v"}, false);
    if (!u_ || !v_)
        u_ = v_ = nullptr;
    for (size_t row = 0; row < faces.rows; ++row)
        SR_CHECK(read_face(row));
    return {};
}

Result<FileMesh> PlyMesh::read()
{
    const PlyElement *vertices = file_.find("vertex"), *faces = file_.find("face");
    if (!vertices || !faces || !faces->rows)
        return fail(ErrorCode::bad_input, "{}: expected a mesh, found no {}", where_, vertices ? "faces" : "vertices");
    if (vertices->rows > kMaxMeshElements || faces->rows > kMaxMeshElements)
        return fail(ErrorCode::bad_input, "{}: {} vertices and {} faces, at most {} are supported", where_,
                    vertices->rows, faces->rows, kMaxMeshElements);
    SR_CHECK(read_vertices(*vertices));
    SR_CHECK(read_textures());
    SR_CHECK(read_colors(*vertices));
    SR_CHECK(read_faces(*vertices, *faces));
    for (std::string& warning : folder_.warnings)
        add_warning(mesh_.warnings, std::move(warning));
    return FileMesh{std::move(mesh_), std::move(positions_)};
}

} // namespace

Result<FileMesh> read_ply_mesh(const Path& path, const MeshReadOptions& options)
{
    SR_TRY(const PlyFile file, read_ply(path));
    return PlyMesh(path, file, options).read();
}

} // namespace semrover
