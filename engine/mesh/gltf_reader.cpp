// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// meshes of a glTF scene, in the pose of the file: nodes, instances, skins and morph targets; triangles, strips, fans
#include "engine/mesh/gltf_materials.h"
#include "engine/mesh/gltf_pose.h"
#include "engine/mesh/mesh_readers.h"
#include "engine/scene/srgb.h"
#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

using Point = std::array<double, 3>;

// how vertices of a mesh come to their places
struct VertexPose {
    GltfMatrix matrix = kGltfIdentity;
    const std::vector<GltfMatrix>* joints = nullptr; // of a skin, in place of the matrix
    std::vector<double> weights;                     // of morph targets
};

class GltfReader {
  public:
    GltfReader(GltfFile& file)
        : file_(file), where_(file.where()),
          max_elements_(std::min<uint64_t>(kMaxMeshElements / 4, kMaxRepeatedElements + file.bytes() / 2)),
          materials_(file, mesh_), pose_(file, max_elements_)
    {
    }

    Result<FileMesh> read();

  private:
    Status read_placement(const GltfPlacement& placement);
    Status read_mesh(const Json& mesh, int64_t index, const VertexPose& pose);
    Status read_primitive(const Json& primitive, const VertexPose& pose, const std::string& where);
    Status read_vertices(const Json& primitive, const VertexPose& pose, const std::string& where);
    Status add_targets(const Json& primitive, const VertexPose& pose, std::span<Point> points,
                       const std::string& where);
    Status add_skin(const Json& attributes, const std::vector<GltfMatrix>& joints, std::span<Point> points,
                    const std::string& where);
    Status read_colors(const Json& attributes, size_t first, size_t count, const std::string& where);
    Status read_uvs(const Json& attributes, size_t material, size_t first, size_t first_face, const std::string& where);
    Status add_faces(const std::vector<uint32_t>& corners, int64_t mode, bool mirrored, uint32_t first,
                     std::string_view where);
    Result<std::vector<uint32_t>> corners_of(const Json& primitive, size_t vertices, const std::string& where) const;

    GltfFile& file_;
    std::string where_;
    uint64_t max_elements_; // vertices, and faces
    Mesh mesh_;
    std::vector<Point> positions_;
    GltfMaterials materials_;
    GltfPose pose_;
    bool any_label_ = false;
};

// a skinned mesh lies where its joints are, wherever its node is
Status GltfReader::read_placement(const GltfPlacement& p)
{
    SR_TRY(const Json* mesh, file_.entry("meshes", p.mesh));
    VertexPose pose;
    SR_TRY(pose.weights, pose_.weights(*p.node, *mesh));
    SR_TRY(const auto skin, file_.integer(*p.node, "skin"));
    SR_TRY(const GltfInstances instances, pose_.instances(*p.node));
    if (skin) {
        if (instances.count > 1)
            add_warning(pose_.warnings, fmt::format("{}: meshes[{}] has a skin and instances, which glTF does not "
                                                    "define: it is there once",
                                                    where_, p.mesh));
        SR_TRY(const std::vector<GltfMatrix> joints, pose_.joints(*skin));
        pose.joints = &joints;
        return read_mesh(*mesh, p.mesh, pose);
    }
    for (size_t i = 0; i < instances.count; ++i) {
        pose.matrix = compose(p.matrix, instances.matrix(i));
        SR_CHECK(read_mesh(*mesh, p.mesh, pose));
    }
    return {};
}

Status GltfReader::read_mesh(const Json& mesh, int64_t index, const VertexPose& pose)
{
    const auto primitives = mesh.find("primitives");
    if (primitives == mesh.end() || !primitives->is_array())
        return fail(ErrorCode::bad_input, "{}: meshes[{}] has no primitives", where_, index);
    for (size_t i = 0; i < primitives->size(); ++i) {
        const std::string where = fmt::format("{}: meshes[{}]: primitives[{}]", where_, index, i);
        const Json& primitive = (*primitives)[i];
        if (!primitive.is_object())
            return fail(ErrorCode::bad_input, "{}: expected an object, found {}", where, primitive.type_name());
        SR_CHECK(read_primitive(primitive, pose, where));
    }
    return {};
}

// morph targets that have a weight
Status GltfReader::add_targets(const Json& primitive, const VertexPose& pose, std::span<Point> points,
                               const std::string& where)
{
    const auto targets = primitive.find("targets");
    if (targets == primitive.end() || !targets->is_array())
        return {};
    for (size_t t = 0; t < std::min(targets->size(), pose.weights.size()); ++t) {
        const double weight = pose.weights[t];
        if (weight == 0 || !(*targets)[t].is_object())
            continue;
        SR_TRY(const auto index, file_.integer((*targets)[t], "POSITION"));
        if (!index)
            continue;
        SR_TRY(const GltfAccessor a, file_.accessor(*index));
        if (a.components != 3 || a.component == 5125 || a.count != points.size())
            return fail(ErrorCode::bad_input, "{}: targets[{}]: POSITION: expected {} vectors of three numbers", where,
                        t, points.size());
        SR_CHECK(pose_.count_work(a.count, "vertices of morph targets"));
        for (size_t i = 0; i < a.count; ++i)
            for (uint32_t c = 0; c < 3; ++c)
                points[i][c] += weight * a.number(i, c);
    }
    return {};
}

Status GltfReader::add_skin(const Json& attributes, const std::vector<GltfMatrix>& joints, std::span<Point> points,
                            const std::string& where)
{
    std::vector<std::pair<GltfAccessor, GltfAccessor>> sets; // joints, weights
    for (size_t set = 0; set < 16; ++set) {
        SR_TRY(const auto joint, file_.integer(attributes, fmt::format("JOINTS_{}", set).c_str()));
        SR_TRY(const auto weight, file_.integer(attributes, fmt::format("WEIGHTS_{}", set).c_str()));
        if (!joint || !weight)
            break;
        SR_TRY(const GltfAccessor j, file_.accessor(*joint));
        SR_TRY(const GltfAccessor w, file_.accessor(*weight));
        const bool types = (j.component == 5121 || j.component == 5123) && (w.component == 5126 || w.normalized);
        if (j.components != 4 || w.components != 4 || !types || j.count != points.size() || w.count != j.count)
            return fail(ErrorCode::bad_input, "{}: JOINTS_{} and WEIGHTS_{}: expected four of each for {} vertices",
                        where, set, set, points.size());
        sets.emplace_back(j, w);
    }
    if (sets.empty())
        return fail(ErrorCode::bad_input, "{}: is skinned and has no JOINTS_0 and WEIGHTS_0", where);
    for (size_t i = 0; i < points.size(); ++i) {
        Point sum{};
        double all = 0;
        for (const auto& [j, w] : sets)
            for (uint32_t c = 0; c < 4; ++c) {
                const double weight = w.number(i, c), joint = j.number(i, c);
                if (weight == 0)
                    continue;
                if (joint >= double(joints.size()))
                    return fail(ErrorCode::bad_input, "{}: vertex {} has joint {}, the skin has {}", where, i, joint,
                                joints.size());
                const Point p = transformed(joints[size_t(joint)], points[i]);
                for (size_t a = 0; a < 3; ++a)
                    sum[a] += weight * p[a];
                all += weight;
            }
        if (!(std::abs(all) > 0))
            return fail(ErrorCode::bad_input, "{}: vertex {} is skinned without weights", where, i);
        for (size_t a = 0; a < 3; ++a)
            points[i][a] = sum[a] / all;
    }
    return {};
}

Status GltfReader::read_vertices(const Json& primitive, const VertexPose& pose, const std::string& where)
{
    const Json& attributes = primitive["attributes"];
    SR_TRY(const auto position, file_.integer(attributes, "POSITION"));
    SR_TRY(const GltfAccessor p, file_.accessor(position.value_or(-1)));
    if (p.components != 3 || p.component == 5125)
        return fail(ErrorCode::bad_input, "{}: POSITION: expected vectors of three numbers", where);
    const size_t first = positions_.size();
    if (first + p.count > max_elements_)
        return fail(ErrorCode::bad_input, "{}: {} vertices with those before it, at most {} from files of {} bytes",
                    where, first + p.count, max_elements_, file_.bytes());
    for (size_t i = 0; i < p.count; ++i)
        positions_.push_back({p.number(i, 0), p.number(i, 1), p.number(i, 2)});
    const std::span<Point> points = std::span(positions_).subspan(first);
    SR_CHECK(add_targets(primitive, pose, points, where));
    if (pose.joints)
        SR_CHECK(add_skin(attributes, *pose.joints, points, where));
    else
        for (Point& point : points)
            point = transformed(pose.matrix, point);
    return read_colors(attributes, first, p.count, where);
}

// linear, and perhaps with alpha
Status GltfReader::read_colors(const Json& attributes, size_t first, size_t count, const std::string& where)
{
    SR_TRY(const auto color, file_.integer(attributes, "COLOR_0"));
    if (!color)
        return {};
    SR_TRY(const GltfAccessor c, file_.accessor(*color));
    if (c.count != count || c.components < 3 || !(c.component == 5121 || c.component == 5123 || c.component == 5126))
        return fail(ErrorCode::bad_input, "{}: COLOR_0: expected {} colours of bytes, shorts or floats", where, count);
    mesh_.colors.resize(first, {255, 255, 255});
    const double whole = c.normalized || c.component == 5126 ? 1 : c.component == 5121 ? 255 : 65535;
    const auto share = [&](size_t i, uint32_t a) {
        const double value = c.number(i, a) / whole;
        return std::isfinite(value) ? std::clamp(value, 0.0, 1.0) : 0;
    };
    for (size_t i = 0; i < c.count; ++i) {
        std::array<uint8_t, 3> rgb;
        for (uint32_t a = 0; a < 3; ++a)
            rgb[a] = uint8_t(std::lround(255 * srgb_of_linear(share(i, a))));
        mesh_.colors.push_back(rgb);
        const auto alpha = uint8_t(c.components == 4 ? std::lround(255 * share(i, 3)) : 255);
        if (alpha < 255 || !mesh_.alphas.empty()) {
            mesh_.alphas.resize(first + i, 255);
            mesh_.alphas.push_back(alpha);
        }
    }
    return {};
}

Result<std::vector<uint32_t>> GltfReader::corners_of(const Json& primitive, size_t vertices,
                                                     const std::string& where) const
{
    std::vector<uint32_t> corners;
    SR_TRY(const auto indices, file_.integer(primitive, "indices"));
    if (!indices) {
        for (uint32_t i = 0; i < vertices; ++i)
            corners.push_back(i);
        return corners;
    }
    SR_TRY(const GltfAccessor a, file_.accessor(*indices));
    if (a.components != 1 || !(a.component == 5121 || a.component == 5123 || a.component == 5125))
        return fail(ErrorCode::bad_input, "{}: indices: expected unsigned numbers", where);
    for (size_t i = 0; i < a.count; ++i) {
        corners.push_back(a.index(i));
        if (corners.back() >= vertices)
            return fail(ErrorCode::bad_input, "{}: refers to vertex {}, there are {}", where, corners.back(), vertices);
    }
    return corners;
}

// lists (4), strips (5) and fans (6)
Status GltfReader::add_faces(const std::vector<uint32_t>& corners, int64_t mode, bool mirrored, uint32_t first,
                             std::string_view where)
{
    const size_t step = mode == 4 ? 3 : 1, faces = corners.size() < 3 ? 0 : (corners.size() - 3) / step + 1;
    if (mesh_.faces.size() + faces > max_elements_)
        return fail(ErrorCode::bad_input, "{}: {} triangles with those before it, at most {} from files of {} bytes",
                    where, mesh_.faces.size() + faces, max_elements_, file_.bytes());
    for (size_t i = 0; i + 2 < corners.size(); i += step) {
        std::array<uint32_t, 3> f = {corners[mode == 6 ? 0 : i], corners[i + 1], corners[i + 2]};
        if ((mode == 5 && i % 2 == 1) != mirrored)
            std::swap(f[1], f[2]);
        for (uint32_t& v : f)
            v += first;
        mesh_.faces.push_back(f);
    }
    return {};
}

// those of a texture; without any the texture is left out
Status GltfReader::read_uvs(const Json& attributes, size_t material, size_t first, size_t first_face,
                            const std::string& where)
{
    const GltfTextureView& view = materials_.view(material);
    if (mesh_.materials[material].texture < 0)
        return {};
    SR_TRY(const auto texcoord, file_.integer(attributes, fmt::format("TEXCOORD_{}", view.set).c_str()));
    if (!texcoord) { // the specification leaves it open; viewers show the base colour
        mesh_.face_materials.resize(first_face);
        mesh_.face_materials.resize(mesh_.faces.size(), materials_.untextured(uint32_t(material)));
        add_warning(mesh_.warnings, fmt::format("{}: has a texture but no TEXCOORD_{}", where, view.set));
        return {};
    }
    SR_TRY(const GltfAccessor uv, file_.accessor(*texcoord));
    if (uv.components != 2 || uv.count != positions_.size() - first)
        return fail(ErrorCode::bad_input, "{}: TEXCOORD_{}: expected {} pairs", where, view.set,
                    positions_.size() - first);
    mesh_.uvs.resize(mesh_.faces.size());
    for (size_t f = first_face; f < mesh_.faces.size(); ++f)
        for (size_t c = 0; c < 3; ++c) {
            const size_t v = mesh_.faces[f][c] - first;
            mesh_.uvs[f][c] = view.apply(uv.number(v, 0), uv.number(v, 1));
        }
    return {};
}

Status GltfReader::read_primitive(const Json& primitive, const VertexPose& pose, const std::string& where)
{
    SR_TRY(const auto mode_given, file_.integer(primitive, "mode"));
    SR_TRY(const auto material_given, file_.integer(primitive, "material"));
    const int64_t mode = mode_given.value_or(4);
    const auto attributes = primitive.find("attributes");
    const auto extensions = primitive.find("extensions");
    if (mode < 4) // points and lines have no surface
        return {};
    if (mode > 6 || attributes == primitive.end() || !attributes->is_object())
        return fail(ErrorCode::bad_input, "{}: expected triangles, strips or fans with attributes", where);
    if (extensions != primitive.end() && extensions->is_object() && extensions->contains("KHR_draco_mesh_compression"))
        return fail(ErrorCode::bad_input, "{}: is compressed by Draco, which is not supported; write the file without",
                    where);
    pose_.note_extensions(primitive);
    const size_t first = positions_.size(), first_face = mesh_.faces.size();
    SR_CHECK(read_vertices(primitive, pose, where));
    const size_t vertices = positions_.size() - first;
    const int64_t material = material_given.value_or(int64_t(materials_.count()) - 1);
    if (material < 0 || material >= int64_t(materials_.count()))
        return fail(ErrorCode::bad_input, "{}: refers to materials[{}], there are {}", where, material,
                    materials_.count() - 1);
    SR_TRY(const std::vector<uint32_t> corners, corners_of(primitive, vertices, where));
    const bool mirrored = determinant(pose.joints ? pose.joints->front() : pose.matrix) < 0;
    SR_CHECK(add_faces(corners, mode, mirrored, uint32_t(first), where));
    const uint8_t label = materials_.view(size_t(material)).label;
    mesh_.face_materials.resize(mesh_.faces.size(), uint32_t(material));
    mesh_.face_labels.resize(mesh_.faces.size(), label);
    any_label_ = any_label_ || label != kNoLabel;
    return read_uvs(*attributes, size_t(material), first, first_face, where);
}

Result<FileMesh> GltfReader::read()
{
    SR_CHECK(materials_.read());
    SR_TRY(const std::vector<GltfPlacement> placements, pose_.placements());
    for (const GltfPlacement& placement : placements)
        SR_CHECK(read_placement(placement));
    if (!mesh_.colors.empty())
        mesh_.colors.resize(positions_.size(), {255, 255, 255});
    if (!mesh_.alphas.empty())
        mesh_.alphas.resize(positions_.size(), 255);
    if (!mesh_.uvs.empty())
        mesh_.uvs.resize(mesh_.faces.size());
    if (!any_label_)
        mesh_.face_labels.clear();
    for (const auto* warnings : {&file_.folder().warnings, &pose_.warnings})
        for (const std::string& warning : *warnings)
            add_warning(mesh_.warnings, warning);
    return FileMesh{std::move(mesh_), std::move(positions_)};
}

} // namespace

Result<FileMesh> read_gltf(const Path& path, const MeshReadOptions& options)
{
    SR_TRY(GltfFile file, GltfFile::open(path, options.missing_textures));
    return GltfReader(file).read();
}

} // namespace semrover
