// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/splat_file.h"

#include "engine/format/gltf_document.h"
#include "engine/scene/srgb.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace semrover {

namespace {

constexpr const char* kExtension = "KHR_gaussian_splatting";
// the world's axes in the file's
constexpr Rigid kToFile = {0, -1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 0, 0, 0, 0, 1};

// Hamilton product of x, y, z, w
std::array<double, 4> product(const std::array<double, 4>& a, const std::array<double, 4>& b)
{
    return {
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1], a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
        a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3], a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]};
}

// ---- reading

struct Attributes {
    GltfDocument::Values position, rotation, scale, opacity, harmonic, color, label;
    bool view_dependent = false;
};

struct SplatPlacement {
    Rigid rigid; // from the file's axes and the node's to the world's
    double scale = 1;
    std::array<double, 4> rotation{};
};

Result<SplatPlacement> placement_of(const std::array<double, 16>& m, const std::string& where)
{
    double squares = 0;
    for (size_t row = 0; row < 3; ++row)
        squares += m[4 * row] * m[4 * row];
    SplatPlacement p;
    p.scale = std::sqrt(squares);
    std::array<double, 16> unit = m;
    for (size_t row = 0; row < 3; ++row)
        for (size_t col = 0; col < 3; ++col)
            unit[4 * row + col] /= p.scale;
    const auto rigid = rigid_from_matrix(unit, where);
    if (!(p.scale > 0) || !std::isfinite(p.scale) || !rigid)
        return fail(ErrorCode::bad_input,
                    "{}: splats under a node whose scale is not the same along all axes, or a mirror", where);
    p.rigid = compose(inverse(kToFile), *rigid);
    p.rotation = quaternion_of(p.rigid);
    return p;
}

const Json* attribute(const Json& attributes, const std::string& name)
{
    const auto found = attributes.find(name);
    return found == attributes.end() ? nullptr : &*found;
}

Status read_into(const GltfDocument& d, const Json& attributes, const std::string& name,
                 std::initializer_list<std::string_view> types, bool required, GltfDocument::Values& out,
                 const std::string& where)
{
    const Json* index = attribute(attributes, name);
    if (!index && required)
        return fail(ErrorCode::bad_input, "{}: splats without the attribute {}", where, name);
    if (index) {
        SR_TRY(out, d.read(*index, types, name));
    }
    return {};
}

Result<Attributes> attributes_of(const GltfDocument& d, const Json& json, const std::string& where)
{
    const std::string prefix = std::string(kExtension) + ":";
    Attributes a;
    SR_CHECK(read_into(d, json, "POSITION", {"VEC3"}, true, a.position, where));
    SR_CHECK(read_into(d, json, prefix + "ROTATION", {"VEC4"}, true, a.rotation, where));
    SR_CHECK(read_into(d, json, prefix + "SCALE", {"VEC3"}, true, a.scale, where));
    SR_CHECK(read_into(d, json, prefix + "OPACITY", {"SCALAR"}, true, a.opacity, where));
    SR_CHECK(read_into(d, json, prefix + "SH_DEGREE_0_COEF_0", {"VEC3"}, false, a.harmonic, where));
    SR_CHECK(read_into(d, json, "_LABEL", {"SCALAR"}, false, a.label, where));
    if (a.harmonic.data.empty())
        SR_CHECK(read_into(d, json, "COLOR_0", {"VEC3", "VEC4"}, true, a.color, where));
    a.view_dependent = attribute(json, prefix + "SH_DEGREE_1_COEF_0") != nullptr;
    const size_t n = a.position.count();
    for (const auto* values : {&a.rotation, &a.scale, &a.opacity, &a.harmonic, &a.color, &a.label})
        if (values->components && values->count() != n)
            return fail(ErrorCode::bad_input, "{}: {} positions, but {} of another attribute", where, n,
                        values->count());
    return a;
}

Ellipsoid ellipsoid_of(const Attributes& a, size_t i, const SplatPlacement& p)
{
    Ellipsoid e;
    const float* at = &a.position.data[3 * i];
    e.position = transform(p.rigid, {p.scale * at[0], p.scale * at[1], p.scale * at[2]});
    std::array<double, 4> q;
    for (size_t c = 0; c < 4; ++c)
        q[c] = a.rotation.data[4 * i + c];
    e.rotation = product(p.rotation, q);
    for (size_t c = 0; c < 3; ++c) {
        e.scale[c] = p.scale * a.scale.data[3 * i + c];
        e.color[c] = a.harmonic.components ? 0.5 + double(kHarmonic0) * a.harmonic.data[3 * i + c]
                                           : srgb_of_linear(a.color.data[a.color.components * i + c]);
    }
    e.opacity = a.opacity.data[i];
    if (a.label.components && a.label.data[i] >= 0 && a.label.data[i] <= 255)
        e.label = static_cast<uint8_t>(a.label.data[i]);
    return e;
}

Status add_primitive(const GltfDocument& d, const Json& primitive, const SplatPlacement& placement,
                     EllipsoidFlattener& flattener, const std::string& where)
{
    const auto json = primitive.find("attributes");
    if (json == primitive.end() || !json->is_object() || primitive.value("mode", Json(4)) != 0)
        return fail(ErrorCode::bad_input, "{}: splats must be points (mode 0) with attributes", where);
    SR_TRY(const Attributes a, attributes_of(d, *json, where));
    for (size_t i = 0; i < a.position.count(); ++i) {
        for (size_t c = 0; c < 3; ++c)
            if (a.scale.data[3 * i + c] < 0)
                return fail(ErrorCode::bad_input,
                            "{}: splat {}: a scale of {}: an early draft of {} stored logarithms, which are not read",
                            where, i, a.scale.data[3 * i + c], kExtension);
        flattener.add(ellipsoid_of(a, i, placement));
        if (a.view_dependent)
            flattener.count_view_dependent();
    }
    return {};
}

bool has_splats(const Json& primitive)
{
    return primitive.is_object() && primitive.contains("extensions") && primitive["extensions"].is_object() &&
           primitive["extensions"].contains(kExtension);
}

} // namespace

Result<SplatFile> read_splats_glb(const Path& path)
{
    const std::string where = quote_path(path);
    SR_TRY(const GltfDocument d, GltfDocument::open(path));
    SR_TRY(const std::vector<GltfInstance> instances, d.instances());
    EllipsoidFlattener flattener(where);
    bool found = false;
    for (const GltfInstance& instance : instances) {
        const Json* mesh = d.entry("meshes", instance.mesh);
        const auto primitives = mesh ? mesh->find("primitives") : Json::const_iterator();
        if (!mesh || primitives == mesh->end() || !primitives->is_array())
            continue;
        for (const Json& primitive : *primitives)
            if (has_splats(primitive)) {
                if (instance.repeated)
                    return fail(ErrorCode::bad_input,
                                "{}: splats of mesh {} are repeated by EXT_mesh_gpu_instancing, which is not "
                                "supported; write the file with a node for each",
                                where, instance.mesh);
                SR_TRY(const SplatPlacement placement, placement_of(instance.transform, where));
                SR_CHECK(add_primitive(d, primitive, placement, flattener, where));
                found = true;
            }
    }
    if (!found)
        return fail(ErrorCode::bad_input, "{}: has no splats ({}); meshes go through voxelize", where, kExtension);
    return std::move(flattener).finish();
}

// ---- writing

namespace {

// attributes one after the other in one buffer, all floats
class AttributeWriter {
  public:
    void add(const std::string& name, const char* type, const std::vector<float>& values, size_t count)
    {
        const size_t begin = binary.size();
        binary.resize(begin + values.size() * sizeof(float));
        std::memcpy(binary.data() + begin, values.data(), values.size() * sizeof(float));
        attributes[name] = views.size();
        accessors.push_back({{"bufferView", views.size()}, {"componentType", 5126}, {"count", count}, {"type", type}});
        views.push_back(
            {{"buffer", 0}, {"byteOffset", begin}, {"byteLength", binary.size() - begin}, {"target", 34962}});
    }

    std::vector<std::byte> binary;
    Json attributes = Json::object(), accessors = Json::array(), views = Json::array();
};

// the least and largest of each component, as glTF wants it for POSITION
void add_bounds(Json& accessor, const std::vector<float>& positions)
{
    std::array<float, 3> low, high;
    for (size_t a = 0; a < 3; ++a) {
        low[a] = high[a] = positions[a];
        for (size_t i = a; i < positions.size(); i += 3) {
            low[a] = std::min(low[a], positions[i]);
            high[a] = std::max(high[a], positions[i]);
        }
    }
    accessor["min"] = low;
    accessor["max"] = high;
}

AttributeWriter attributes_of(const Splats& s)
{
    const size_t n = s.position.size();
    const std::array<double, 4> turn = quaternion_of(kToFile);
    std::vector<float> positions, colors, rotations, scales, harmonics, labels;
    for (size_t i = 0; i < n; ++i) {
        const auto& p = s.position[i];
        positions.insert(positions.end(), {-p[1], p[2], -p[0]});
        const auto [w, x, y, z] = splat_rotation(s.normal[i]);
        for (const double q : product(turn, {x, y, z, w}))
            rotations.push_back(static_cast<float>(q));
        scales.insert(scales.end(), {s.sigma_u[i], s.sigma_v[i], kThinScale});
        for (const float c : s.color[i]) {
            harmonics.push_back((c - 0.5f) / kHarmonic0);
            colors.push_back(static_cast<float>(linear_of_srgb(std::clamp(c, 0.f, 1.f))));
        }
        colors.push_back(std::clamp(s.opacity[i], 0.f, 1.f));
        labels.push_back(s.label[i]);
    }
    std::vector<float> opacities = s.opacity;
    for (float& o : opacities)
        o = std::clamp(o, 0.f, 1.f); // values outside are invalid there
    AttributeWriter w;
    const std::string prefix = std::string(kExtension) + ":";
    w.add("POSITION", "VEC3", positions, n);
    add_bounds(w.accessors.back(), positions);
    w.add("COLOR_0", "VEC4", colors, n);
    w.add(prefix + "ROTATION", "VEC4", rotations, n);
    w.add(prefix + "SCALE", "VEC3", scales, n);
    w.add(prefix + "OPACITY", "SCALAR", opacities, n);
    w.add(prefix + "SH_DEGREE_0_COEF_0", "VEC3", harmonics, n);
    if (std::ranges::any_of(s.label, [](uint8_t label) { return label != kNoLabel; }))
        w.add("_LABEL", "SCALAR", labels, n);
    return w;
}

void append_u32(std::string& out, uint64_t value)
{
    for (int i = 0; i < 4; ++i)
        out += static_cast<char>((value >> (8 * i)) & 255);
}

} // namespace

Status write_splats_glb(const Path& path, const Splats& s)
{
    SR_CHECK(check_splats(path, s));
    const AttributeWriter w = attributes_of(s);
    const Json primitive = {{"attributes", w.attributes},
                            {"mode", 0},
                            {"extensions",
                             {{kExtension,
                               {{"kernel", "ellipse"},
                                {"colorSpace", "srgb_rec709_display"},
                                {"sortingMethod", "cameraDistance"},
                                {"projection", "perspective"}}}}}};
    const Json json = {{"asset", {{"version", "2.0"}, {"generator", "semrover"}}},
                       {"extensionsUsed", {kExtension}},
                       {"scene", 0},
                       {"scenes", {{{"nodes", {0}}}}},
                       {"nodes", {{{"mesh", 0}, {"name", "splats"}}}},
                       {"meshes", {{{"primitives", {primitive}}}}},
                       {"accessors", w.accessors},
                       {"bufferViews", w.views},
                       {"buffers", {{{"byteLength", w.binary.size()}}}}};
    std::string text = json_text(json);
    text.append((4 - text.size() % 4) % 4, ' ');
    const uint64_t total = 12 + 8 + text.size() + 8 + w.binary.size(); // floats: whole words
    if (total > 0xffffffffu)
        return fail(ErrorCode::bad_input, "cannot write {}: {} bytes, a .glb holds 4 GiB", quote_path(path), total);
    std::string head = "glTF";
    append_u32(head, 2);
    append_u32(head, total);
    append_u32(head, text.size());
    head += "JSON" + text;
    append_u32(head, w.binary.size());
    head += std::string("BIN\0", 4);
    SR_TRY(AtomicFile file, AtomicFile::create(path));
    SR_CHECK(file.write(head));
    SR_CHECK(file.write(w.binary));
    return file.commit();
}

} // namespace semrover
