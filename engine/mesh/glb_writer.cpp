// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// glTF 2.0, https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html: one mesh, one primitive per material and label
#include "engine/mesh/labels.h"
#include "engine/mesh/mesh_files.h"
#include "engine/scene/palette.h"
#include "engine/scene/srgb.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "runtime/graph/tensor.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <unordered_map>

namespace semrover {

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie in memory");

namespace {

using OrderedJson = nlohmann::ordered_json;
constexpr int kFloat = 5126, kUnsignedShort = 5123, kUnsignedInt = 5125;
constexpr int kVertices = 34962, kIndices = 34963; // buffer view targets
constexpr int kWraps[] = {10497, 33648, 33071};    // by TextureWrap
constexpr uint64_t kMaxBytes = 0xffff0000;         // lengths are 32 bits

struct PrimitiveKey {
    int64_t material; // -1: none
    uint8_t label;
    auto operator<=>(const PrimitiveKey&) const = default;
};

// a vertex of a primitive: one of the mesh's, with the texture coordinates of a corner
struct CornerKey {
    uint32_t vertex;
    std::array<uint32_t, 2> uv; // bits
    bool operator==(const CornerKey&) const = default;
};
struct CornerHash {
    size_t operator()(const CornerKey& k) const
    {
        return size_t((k.vertex * 0x9E3779B97F4A7C15ull ^ k.uv[0]) * 0xC2B2AE3D27D4EB4Full ^ k.uv[1]);
    }
};

struct Primitive {
    std::vector<std::array<float, 3>> positions;
    std::vector<std::array<float, 2>> uvs;
    std::vector<std::array<uint16_t, 4>> colors; // linear, and opaque
    std::vector<uint32_t> indices;
};

// x forward, y left, z up -> y up, -z forward
std::array<float, 3> to_y_up(const std::array<float, 3>& p)
{
    return {-p[1], p[2], -p[0]};
}

uint16_t linear16(uint8_t srgb)
{
    return uint16_t(std::lround(65535 * kLinear[srgb]));
}

class GlbWriter {
  public:
    GlbWriter(const Mesh& mesh, std::string where) : mesh_(mesh), where_(std::move(where)) {}

    Result<std::string> write();

  private:
    std::map<PrimitiveKey, std::vector<uint32_t>> group_faces() const;
    Primitive gather(const PrimitiveKey& key, const std::vector<uint32_t>& faces) const;
    OrderedJson write_primitive(const Primitive& p);
    OrderedJson write_material(const PrimitiveKey& key);
    Status write_textures();
    bool is_textured(int64_t material) const
    {
        return material >= 0 && mesh_.materials[size_t(material)].texture >= 0 && !mesh_.uvs.empty();
    }
    size_t add_view(const void* data, size_t bytes, int target);
    size_t add_accessor(const void* data, size_t bytes, int target, OrderedJson accessor);

    const Mesh& mesh_;
    std::string where_;
    std::string binary_;
    OrderedJson views_ = OrderedJson::array(), accessors_ = OrderedJson::array();
    OrderedJson images_ = OrderedJson::array(), samplers_ = OrderedJson::array(), textures_ = OrderedJson::array();
};

std::map<PrimitiveKey, std::vector<uint32_t>> GlbWriter::group_faces() const
{
    std::map<PrimitiveKey, std::vector<uint32_t>> groups;
    for (uint32_t f = 0; f < mesh_.faces.size(); ++f) {
        const int64_t material = mesh_.face_materials.empty() ? -1 : int64_t(mesh_.face_materials[f]);
        groups[{material, mesh_.face_labels.empty() ? kNoLabel : mesh_.face_labels[f]}].push_back(f);
    }
    return groups;
}

Primitive GlbWriter::gather(const PrimitiveKey& key, const std::vector<uint32_t>& faces) const
{
    Primitive p;
    const bool textured = is_textured(key.material);
    std::unordered_map<CornerKey, uint32_t, CornerHash> seen;
    for (const uint32_t f : faces)
        for (size_t corner = 0; corner < 3; ++corner) {
            CornerKey k{mesh_.faces[f][corner], {}};
            if (textured)
                k.uv = std::bit_cast<std::array<uint32_t, 2>>(mesh_.uvs[f][corner]);
            const auto [at, is_new] = seen.try_emplace(k, uint32_t(p.positions.size()));
            p.indices.push_back(at->second);
            if (!is_new)
                continue;
            p.positions.push_back(to_y_up(mesh_.positions[k.vertex]));
            if (textured)
                p.uvs.push_back(mesh_.uvs[f][corner]);
            if (!mesh_.colors.empty()) {
                const auto& c = mesh_.colors[k.vertex];
                p.colors.push_back({linear16(c[0]), linear16(c[1]), linear16(c[2]), 65535});
            }
        }
    return p;
}

size_t GlbWriter::add_view(const void* data, size_t bytes, int target)
{
    binary_.resize(round_up64(binary_.size(), 4), '\0');
    OrderedJson view = {{"buffer", 0}, {"byteOffset", binary_.size()}, {"byteLength", bytes}};
    if (target)
        view["target"] = target;
    binary_.append(static_cast<const char*>(data), bytes);
    views_.push_back(std::move(view));
    return views_.size() - 1;
}

size_t GlbWriter::add_accessor(const void* data, size_t bytes, int target, OrderedJson accessor)
{
    OrderedJson a = {{"bufferView", add_view(data, bytes, target)}};
    a.update(accessor);
    accessors_.push_back(std::move(a));
    return accessors_.size() - 1;
}

OrderedJson GlbWriter::write_primitive(const Primitive& p)
{
    std::array<float, 3> low = p.positions[0], high = low;
    for (const auto& v : p.positions)
        for (size_t a = 0; a < 3; ++a) {
            low[a] = std::min(low[a], v[a]);
            high[a] = std::max(high[a], v[a]);
        }
    const size_t n = p.positions.size();
    OrderedJson attributes;
    attributes["POSITION"] = add_accessor(
        p.positions.data(), n * 12, kVertices,
        {{"componentType", kFloat}, {"count", n}, {"type", "VEC3"}, {"min", OrderedJson(low)}, {"max", high}});
    if (!p.uvs.empty())
        attributes["TEXCOORD_0"] =
            add_accessor(p.uvs.data(), n * 8, kVertices, {{"componentType", kFloat}, {"count", n}, {"type", "VEC2"}});
    if (!p.colors.empty())
        attributes["COLOR_0"] =
            add_accessor(p.colors.data(), n * 8, kVertices,
                         {{"componentType", kUnsignedShort}, {"normalized", true}, {"count", n}, {"type", "VEC4"}});
    const size_t indices =
        add_accessor(p.indices.data(), p.indices.size() * 4, kIndices,
                     {{"componentType", kUnsignedInt}, {"count", p.indices.size()}, {"type", "SCALAR"}});
    return {{"attributes", attributes}, {"indices", indices}};
}

OrderedJson GlbWriter::write_material(const PrimitiveKey& key)
{
    const Material plain;
    const Material& m = key.material < 0 ? plain : mesh_.materials[size_t(key.material)];
    OrderedJson pbr, json;
    std::string name = m.name;
    if (key.label != kNoLabel && class_of_material(name) != key.label)
        name = fmt::format("{}{}{}", kPalette[key.label].name, name.empty() ? "" : ".", name);
    if (!name.empty())
        json["name"] = printable(name);
    pbr["baseColorFactor"] = {short_number(m.color[0]), short_number(m.color[1]), short_number(m.color[2]), 1};
    if (is_textured(key.material))
        pbr["baseColorTexture"] = {{"index", m.texture}};
    pbr["metallicFactor"] = 0;
    pbr["roughnessFactor"] = 1;
    json["pbrMetallicRoughness"] = pbr;
    json["doubleSided"] = true;
    if (key.label != kNoLabel)
        json["extras"] = {{"label", key.label}};
    return json;
}

Status GlbWriter::write_textures()
{
    for (const Texture& t : mesh_.textures) {
        SR_TRY(const std::vector<std::byte> png, encode_png_rgb8(t.image.width, t.image.height, t.image.pixels));
        const OrderedJson sampler = {{"wrapS", kWraps[size_t(t.wrap_u)]}, {"wrapT", kWraps[size_t(t.wrap_v)]}};
        auto at = std::find(samplers_.begin(), samplers_.end(), sampler);
        if (at == samplers_.end())
            at = samplers_.insert(samplers_.end(), sampler);
        textures_.push_back({{"sampler", at - samplers_.begin()}, {"source", images_.size()}});
        images_.push_back({{"bufferView", add_view(png.data(), png.size(), 0)}, {"mimeType", "image/png"}});
    }
    return {};
}

void append_chunk(std::string& file, const char* type, std::string data, char padding)
{
    data.resize(round_up64(data.size(), 4), padding);
    const auto bytes = uint32_t(data.size());
    file.append(reinterpret_cast<const char*>(&bytes), 4);
    file.append(type, 4);
    file += data;
}

Result<std::string> GlbWriter::write()
{
    OrderedJson primitives = OrderedJson::array(), materials = OrderedJson::array();
    for (const auto& [key, faces] : group_faces()) {
        OrderedJson primitive = write_primitive(gather(key, faces));
        primitive["material"] = materials.size();
        materials.push_back(write_material(key));
        primitives.push_back(std::move(primitive));
    }
    SR_CHECK(write_textures());
    OrderedJson json = {{"asset", {{"version", "2.0"}, {"generator", "semrover"}}}, {"scene", 0}};
    json["scenes"] = {{{"nodes", {0}}}};
    json["nodes"] = {{{"mesh", 0}}};
    json["meshes"] = {{{"primitives", primitives}}};
    json["materials"] = materials;
    if (!textures_.empty()) {
        json["textures"] = textures_;
        json["samplers"] = samplers_;
        json["images"] = images_;
    }
    json["accessors"] = accessors_;
    json["bufferViews"] = views_;
    json["buffers"] = {{{"byteLength", binary_.size()}}};
    if (binary_.size() > kMaxBytes)
        return fail(ErrorCode::bad_input, "{}: {} bytes, a GLB file holds 4 GiB at most", where_, binary_.size());
    std::string chunks;
    append_chunk(chunks, "JSON", json_text(json), ' ');
    append_chunk(chunks, "BIN", std::move(binary_), '\0');
    std::string file = "glTF";
    const uint32_t numbers[2] = {2, uint32_t(chunks.size() + 12)};
    file.append(reinterpret_cast<const char*>(numbers), 8);
    return file + chunks;
}

} // namespace

Status write_glb(const Path& path, const Mesh& mesh)
{
    const std::string where = "cannot write " + quote_path(path);
    SR_CHECK(check_mesh(mesh, where));
    SR_TRY(const std::string file, GlbWriter(mesh, where).write());
    return write_file_atomically(path, file);
}

} // namespace semrover
