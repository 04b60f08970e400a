// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// meshes of a glTF scene: nodes composed, triangles, strips and fans, base colours and their textures
#include "engine/mesh/gltf_file.h"
#include "engine/mesh/mesh_readers.h"
#include "engine/scene/srgb.h"
#include "runtime/base/json_fields.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

using Matrix = std::array<double, 16>; // row-major

constexpr size_t kMaxWarnings = 10;
constexpr Matrix kOne = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

Matrix product(const Matrix& a, const Matrix& b)
{
    Matrix m{};
    for (size_t r = 0; r < 4; ++r)
        for (size_t c = 0; c < 4; ++c)
            for (size_t k = 0; k < 4; ++k)
                m[4 * r + c] += a[4 * r + k] * b[4 * k + c];
    return m;
}

double determinant(const Matrix& m)
{
    return m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
           m[2] * (m[4] * m[9] - m[5] * m[8]);
}

// an object in objects, by its keys; null when it is not there
const Json* find_object(const Json& object, std::initializer_list<const char*> keys)
{
    const Json* at = &object;
    for (const char* key : keys) {
        const auto found = at->find(key);
        if (found == at->end() || !found->is_object())
            return nullptr;
        at = &*found;
    }
    return at;
}

// how a material sees texture coordinates
struct TextureView {
    int64_t set = 0; // TEXCOORD_n
    double offset[2] = {0, 0}, scale[2] = {1, 1}, rotation = 0;
    uint8_t label = kNoLabel;

    std::array<float, 2> apply(double u, double v) const
    {
        const double su = scale[0] * u, sv = scale[1] * v, c = std::cos(rotation), s = std::sin(rotation);
        return {float(c * su + s * sv + offset[0]), float(c * sv - s * su + offset[1])};
    }
};

class GltfReader {
  public:
    explicit GltfReader(GltfFile& file)
        : file_(file), where_(file.where()),
          max_elements_(std::min<uint64_t>(kMaxMeshElements / 4, kMaxRepeatedElements + file.bytes() / 2))
    {
    }

    Result<Mesh> read();

  private:
    Status read_materials();
    Status read_base_color(const Json& pbr, const char* factor, const char* texture, const std::string& where,
                           Material& material, TextureView& view);
    Status read_texture(const Json& info, const std::string& where, Material& material, TextureView& view);
    Result<int32_t> texture_of(int64_t image, TextureWrap u, TextureWrap v);
    uint32_t untextured(uint32_t material);
    Result<TextureWrap> wrap_of(const Json& texture, const char* key) const;
    Result<std::vector<int64_t>> roots() const;
    Result<std::vector<int64_t>> indices_in(const Json& object, const char* key) const;
    Result<Matrix> matrix_of(const Json& node, const std::string& where) const;
    Result<std::vector<double>> numbers(const Json& object, const char* key, size_t count,
                                        std::string_view where) const;
    Status push_node(int64_t index, const Matrix& parent);
    Status read_node(int64_t index, const Matrix& parent);
    Status read_mesh(int64_t index, const Matrix& matrix);
    Status read_primitive(const Json& primitive, const Matrix& matrix, const std::string& where);
    Status read_vertices(const Json& attributes, const Matrix& matrix, const std::string& where);
    Status add_faces(const std::vector<uint32_t>& corners, int64_t mode, bool mirrored, uint32_t first,
                     std::string_view where);
    Result<std::vector<uint32_t>> corners_of(const Json& primitive, size_t vertices, const std::string& where) const;

    GltfFile& file_;
    std::string where_;
    uint64_t max_elements_; // vertices, and faces
    Mesh mesh_;
    std::vector<TextureView> views_;          // of materials
    std::map<uint32_t, uint32_t> untextured_; // the same without their textures
    std::map<std::tuple<const std::byte*, TextureWrap, TextureWrap>, int32_t> textures_; // by the image's file
    TextureBudget texture_budget_;
    std::vector<bool> visited_;
    struct Pending {
        int64_t node;
        Matrix parent;
    };
    std::vector<Pending> pending_;
    bool any_label_ = false, any_uv_ = false;
};

Result<std::vector<double>> GltfReader::numbers(const Json& object, const char* key, size_t count,
                                                std::string_view where) const
{
    const auto found = object.find(key);
    if (found == object.end())
        return std::vector<double>();
    SR_TRY(std::vector<double> values, numbers_of(*found, fmt::format("{}: {}", where, key)));
    if (values.size() != count)
        return fail(ErrorCode::bad_input, "{}: {}: expected {} numbers, found {}", where, key, count, values.size());
    return values;
}

Result<TextureWrap> GltfReader::wrap_of(const Json& texture, const char* key) const
{
    SR_TRY(const auto index, file_.integer(texture, "sampler"));
    if (!index)
        return TextureWrap::repeat;
    SR_TRY(const Json* sampler, file_.entry("samplers", *index));
    SR_TRY(const auto wrap, file_.integer(*sampler, key));
    switch (wrap.value_or(10497)) {
    case 10497:
        return TextureWrap::repeat;
    case 33648:
        return TextureWrap::mirror;
    case 33071:
        return TextureWrap::clamp;
    default:
        return fail(ErrorCode::bad_input, "{}: samplers[{}]: {} is no wrap mode", where_, *index, *wrap);
    }
}

Result<int32_t> GltfReader::texture_of(int64_t image, TextureWrap u, TextureWrap v)
{
    SR_TRY(const auto file, file_.image_file(image));
    const auto entry = textures_.find({file.data(), u, v});
    if (entry != textures_.end())
        return entry->second;
    const std::string where = fmt::format("{}: images[{}]", where_, image);
    SR_TRY(ImageRgb8 pixels, decode_image_rgb8(file, where, texture_budget_.pixels_left(file.size())));
    texture_budget_.take(pixels);
    SR_TRY(std::vector<uint16_t> numbers, texture_numbers(file, where));
    mesh_.textures.push_back({std::move(pixels), u, v, std::move(numbers)});
    return textures_[{file.data(), u, v}] = int32_t(mesh_.textures.size() - 1);
}

Status GltfReader::read_texture(const Json& info, const std::string& where, Material& material, TextureView& view)
{
    SR_TRY(const auto index, file_.integer(info, "index"));
    SR_TRY(const auto set, file_.integer(info, "texCoord"));
    view.set = set.value_or(0);
    SR_TRY(const Json* texture, file_.entry("textures", index.value_or(-1)));
    SR_TRY(const auto source, file_.integer(*texture, "source"));
    if (!source)
        return fail(ErrorCode::bad_input, "{}: textures[{}] has no PNG or JPEG image", where, *index);
    SR_TRY(const TextureWrap u, wrap_of(*texture, "wrapS"));
    SR_TRY(const TextureWrap v, wrap_of(*texture, "wrapT"));
    SR_TRY(material.texture, texture_of(*source, u, v));
    const auto extensions = info.find("extensions");
    if (extensions == info.end() || !extensions->is_object() || !extensions->contains("KHR_texture_transform"))
        return {};
    const Json& transform = (*extensions)["KHR_texture_transform"];
    if (!transform.is_object())
        return fail(ErrorCode::bad_input, "{}: KHR_texture_transform: expected an object", where);
    SR_TRY(const auto offset, numbers(transform, "offset", 2, where));
    SR_TRY(const auto scale, numbers(transform, "scale", 2, where));
    SR_TRY(const auto rotation, optional_number(transform, "rotation", where));
    SR_TRY(const auto own_set, file_.integer(transform, "texCoord"));
    std::ranges::copy(offset, view.offset);
    std::ranges::copy(scale, view.scale);
    view.rotation = rotation.value_or(0);
    view.set = own_set.value_or(view.set);
    return {};
}

Status GltfReader::read_base_color(const Json& pbr, const char* factor_key, const char* texture_key,
                                   const std::string& where, Material& material, TextureView& view)
{
    SR_TRY(const auto factor, numbers(pbr, factor_key, 4, where));
    for (size_t a = 0; a < 3 && !factor.empty(); ++a)
        material.color[a] = float(factor[a]);
    const auto texture = pbr.find(texture_key);
    return texture != pbr.end() && texture->is_object() ? read_texture(*texture, where, material, view) : Status{};
}

Status GltfReader::read_materials()
{
    SR_TRY(const size_t count, file_.count("materials"));
    for (size_t i = 0; i < count; ++i) {
        SR_TRY(const Json* json, file_.entry("materials", int64_t(i)));
        const std::string where = fmt::format("{}: materials[{}]", where_, i);
        Material material;
        TextureView view;
        if (const auto name = json->find("name"); name != json->end() && name->is_string())
            material.name = name->get<std::string>();
        if (const auto pbr = json->find("pbrMetallicRoughness"); pbr != json->end() && pbr->is_object())
            SR_CHECK(read_base_color(*pbr, "baseColorFactor", "baseColorTexture", where, material, view));
        // of exporters from before 2.0's end: its colour is the one to take where both are there
        if (const Json* older = find_object(*json, {"extensions", "KHR_materials_pbrSpecularGlossiness"}))
            SR_CHECK(read_base_color(*older, "diffuseFactor", "diffuseTexture", where, material, view));
        if (const auto extras = json->find("extras"); extras != json->end() && extras->is_object()) {
            SR_TRY(const auto label, file_.integer(*extras, "label"));
            if (label && (*label < 0 || *label > 254))
                return fail(ErrorCode::bad_input, "{}: extras: label {}, expected a class", where, *label);
            view.label = label ? uint8_t(*label) : kNoLabel;
        }
        mesh_.materials.push_back(std::move(material));
        views_.push_back(view);
    }
    mesh_.materials.emplace_back(); // of primitives without one
    views_.emplace_back();
    return {};
}

// behind those of the file
uint32_t GltfReader::untextured(uint32_t material)
{
    const auto [entry, is_new] = untextured_.try_emplace(material, uint32_t(mesh_.materials.size()));
    if (is_new) {
        Material plain = mesh_.materials[material];
        plain.texture = -1;
        mesh_.materials.push_back(std::move(plain));
    }
    return entry->second;
}

Result<std::vector<int64_t>> GltfReader::indices_in(const Json& object, const char* key) const
{
    std::vector<int64_t> out;
    const auto list = object.find(key);
    if (list == object.end())
        return out;
    SR_CHECK(check_array(*list, key, where_));
    for (const Json& value : *list) {
        if (!value.is_number_integer() || value < 0)
            return fail(ErrorCode::bad_input, "{}: {}: expected a list of numbers", where_, key);
        out.push_back(value.get<int64_t>());
    }
    return out;
}

// of the default scene, the first one, or all that are no child
Result<std::vector<int64_t>> GltfReader::roots() const
{
    SR_TRY(const auto scene, file_.integer(file_.json(), "scene"));
    SR_TRY(const size_t scenes, file_.count("scenes"));
    if (scene || scenes) {
        SR_TRY(const Json* json, file_.entry("scenes", scene.value_or(0)));
        return indices_in(*json, "nodes");
    }
    SR_TRY(const size_t nodes, file_.count("nodes"));
    std::vector<bool> is_child(nodes);
    for (size_t i = 0; i < is_child.size(); ++i) {
        SR_TRY(const Json* node, file_.entry("nodes", int64_t(i)));
        SR_TRY(const std::vector<int64_t> children, indices_in(*node, "children"));
        for (const int64_t child : children)
            if (child < int64_t(is_child.size()))
                is_child[size_t(child)] = true;
    }
    std::vector<int64_t> out;
    for (size_t i = 0; i < is_child.size(); ++i)
        if (!is_child[i])
            out.push_back(int64_t(i));
    return out;
}

Result<Matrix> GltfReader::matrix_of(const Json& node, const std::string& where) const
{
    SR_TRY(const auto columns, numbers(node, "matrix", 16, where));
    Matrix m = kOne;
    if (!columns.empty()) {
        for (size_t r = 0; r < 4; ++r)
            for (size_t c = 0; c < 4; ++c)
                m[4 * r + c] = columns[4 * c + r];
        return m;
    }
    SR_TRY(const auto t, numbers(node, "translation", 3, where));
    SR_TRY(const auto q, numbers(node, "rotation", 4, where));
    SR_TRY(const auto s, numbers(node, "scale", 3, where));
    if (!q.empty()) {
        const double n = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
        if (!(n > 0.81 && n < 1.21))
            return fail(ErrorCode::bad_input, "{}: rotation: a quaternion of length {:.4g}, expected 1", where,
                        std::sqrt(n));
        const double x = q[0], y = q[1], z = q[2], w = q[3], k = 2 / n;
        m = {1 - k * (y * y + z * z), k * (x * y - w * z),     k * (x * z + w * y),     0, //
             k * (x * y + w * z),     1 - k * (x * x + z * z), k * (y * z - w * x),     0, //
             k * (x * z - w * y),     k * (y * z + w * x),     1 - k * (x * x + y * y), 0, 0, 0, 0, 1};
    }
    for (size_t r = 0; r < 3; ++r) {
        for (size_t c = 0; c < 3 && !s.empty(); ++c)
            m[4 * r + c] *= s[c];
        m[4 * r + 3] = t.empty() ? 0 : t[r];
    }
    return m;
}

// marked when it is put on the list, so that the list has each node once
Status GltfReader::push_node(int64_t index, const Matrix& parent)
{
    SR_CHECK(file_.entry("nodes", index).map([](const Json*) {}));
    if (visited_[size_t(index)])
        return fail(ErrorCode::bad_input, "{}: nodes[{}]: is the child of two nodes, or of itself", where_, index);
    visited_[size_t(index)] = true;
    pending_.push_back({index, parent});
    return {};
}

Status GltfReader::read_node(int64_t index, const Matrix& parent)
{
    SR_TRY(const Json* node, file_.entry("nodes", index));
    const std::string where = fmt::format("{}: nodes[{}]", where_, index);
    SR_TRY(const Matrix own, matrix_of(*node, where));
    const Matrix matrix = product(parent, own);
    SR_TRY(const auto mesh, file_.integer(*node, "mesh"));
    if (mesh)
        SR_CHECK(read_mesh(*mesh, matrix));
    SR_TRY(const std::vector<int64_t> children, indices_in(*node, "children"));
    for (const int64_t child : children)
        SR_CHECK(push_node(child, matrix));
    return {};
}

Status GltfReader::read_mesh(int64_t index, const Matrix& matrix)
{
    SR_TRY(const Json* mesh, file_.entry("meshes", index));
    const auto primitives = mesh->find("primitives");
    if (primitives == mesh->end() || !primitives->is_array())
        return fail(ErrorCode::bad_input, "{}: meshes[{}] has no primitives", where_, index);
    for (size_t i = 0; i < primitives->size(); ++i) {
        const std::string where = fmt::format("{}: meshes[{}]: primitives[{}]", where_, index, i);
        const Json& primitive = (*primitives)[i];
        if (!primitive.is_object())
            return fail(ErrorCode::bad_input, "{}: expected an object, found {}", where, primitive.type_name());
        SR_CHECK(read_primitive(primitive, matrix, where));
    }
    return {};
}

Status GltfReader::read_vertices(const Json& attributes, const Matrix& matrix, const std::string& where)
{
    SR_TRY(const auto position, file_.integer(attributes, "POSITION"));
    SR_TRY(const GltfAccessor p, file_.accessor(position.value_or(-1)));
    SR_TRY(const auto color, file_.integer(attributes, "COLOR_0"));
    if (p.components != 3 || p.component == 5125)
        return fail(ErrorCode::bad_input, "{}: POSITION: expected vectors of three numbers", where);
    const size_t first = mesh_.positions.size();
    if (first + p.count > max_elements_)
        return fail(ErrorCode::bad_input, "{}: {} vertices with those before it, at most {} from files of {} bytes",
                    where, first + p.count, max_elements_, file_.bytes());
    for (size_t i = 0; i < p.count; ++i) {
        const double v[3] = {p.number(i, 0), p.number(i, 1), p.number(i, 2)};
        std::array<float, 3> to;
        for (size_t r = 0; r < 3; ++r)
            to[r] =
                float(matrix[4 * r] * v[0] + matrix[4 * r + 1] * v[1] + matrix[4 * r + 2] * v[2] + matrix[4 * r + 3]);
        mesh_.positions.push_back(to);
    }
    if (!color)
        return {};
    SR_TRY(const GltfAccessor c, file_.accessor(*color));
    if (c.count != p.count || c.components < 3 || !(c.component == 5121 || c.component == 5123 || c.component == 5126))
        return fail(ErrorCode::bad_input, "{}: COLOR_0: expected {} colours of bytes, shorts or floats", where,
                    p.count);
    mesh_.colors.resize(first, {255, 255, 255});
    const double whole = c.component == 5121 ? 255 : c.component == 5123 ? 65535 : 1;
    for (size_t i = 0; i < c.count; ++i) {
        std::array<uint8_t, 3> rgb;
        for (uint32_t a = 0; a < 3; ++a) {
            const double linear = c.number(i, a) / (c.normalized ? 1 : whole);
            rgb[a] =
                uint8_t(std::lround(255 * srgb_of_linear(std::isfinite(linear) ? std::clamp(linear, 0.0, 1.0) : 0)));
        }
        mesh_.colors.push_back(rgb);
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

Status GltfReader::read_primitive(const Json& primitive, const Matrix& matrix, const std::string& where)
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
        return fail(ErrorCode::bad_input, "{}: is compressed by Draco, which is not supported", where);
    const size_t first = mesh_.positions.size(), first_face = mesh_.faces.size();
    SR_CHECK(read_vertices(*attributes, matrix, where));
    const size_t vertices = mesh_.positions.size() - first;
    const int64_t material = material_given.value_or(int64_t(views_.size()) - 1);
    if (material < 0 || material >= int64_t(views_.size()))
        return fail(ErrorCode::bad_input, "{}: refers to materials[{}], there are {}", where, material,
                    views_.size() - 1);
    SR_TRY(const std::vector<uint32_t> corners, corners_of(primitive, vertices, where));
    SR_CHECK(add_faces(corners, mode, determinant(matrix) < 0, uint32_t(first), where));
    const TextureView& view = views_[size_t(material)];
    mesh_.face_materials.resize(mesh_.faces.size(), uint32_t(material));
    mesh_.face_labels.resize(mesh_.faces.size(), view.label);
    mesh_.uvs.resize(mesh_.faces.size());
    any_label_ = any_label_ || view.label != kNoLabel;
    SR_TRY(const auto texcoord, file_.integer(*attributes, fmt::format("TEXCOORD_{}", view.set).c_str()));
    if (mesh_.materials[size_t(material)].texture < 0)
        return {};
    if (!texcoord) { // the specification leaves it open; viewers show the base colour
        mesh_.face_materials.resize(first_face);
        mesh_.face_materials.resize(mesh_.faces.size(), untextured(uint32_t(material)));
        if (mesh_.warnings.size() < kMaxWarnings)
            mesh_.warnings.push_back(fmt::format("{}: has a texture but no TEXCOORD_{}", where, view.set));
        return {};
    }
    SR_TRY(const GltfAccessor uv, file_.accessor(*texcoord));
    if (uv.components != 2 || uv.count != vertices)
        return fail(ErrorCode::bad_input, "{}: TEXCOORD_{}: expected {} pairs", where, view.set, vertices);
    any_uv_ = true;
    for (size_t f = first_face; f < mesh_.faces.size(); ++f)
        for (size_t c = 0; c < 3; ++c) {
            const size_t v = mesh_.faces[f][c] - first;
            mesh_.uvs[f][c] = view.apply(uv.number(v, 0), uv.number(v, 1));
        }
    return {};
}

Result<Mesh> GltfReader::read()
{
    SR_CHECK(read_materials());
    SR_TRY(const size_t nodes, file_.count("nodes"));
    visited_.resize(nodes);
    SR_TRY(const std::vector<int64_t> first, roots());
    for (auto i = first.rbegin(); i != first.rend(); ++i)
        SR_CHECK(push_node(*i, kOne));
    while (!pending_.empty()) {
        const Pending next = pending_.back();
        pending_.pop_back();
        SR_CHECK(read_node(next.node, next.parent));
    }
    if (!mesh_.colors.empty())
        mesh_.colors.resize(mesh_.positions.size(), {255, 255, 255});
    if (!any_uv_)
        mesh_.uvs.clear();
    if (!any_label_)
        mesh_.face_labels.clear();
    return std::move(mesh_);
}

} // namespace

Result<Mesh> read_gltf(const Path& path)
{
    SR_TRY(GltfFile file, GltfFile::open(path));
    return GltfReader(file).read();
}

} // namespace semrover
