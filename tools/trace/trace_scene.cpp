// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/trace/trace_scene.h"

#include "engine/mesh/transparency.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

namespace semrover {

namespace {

using Float3 = std::array<float, 3>;
constexpr float kCrease = 0.72f; // cosine

Float3 minus(const Float3& a, const Float3& b)
{
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Float3 cross(const Float3& a, const Float3& b)
{
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
float dot(const Float3& a, const Float3& b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Float3 unit(const Float3& a)
{
    const float l = std::sqrt(dot(a, a));
    return l > 0 ? Float3{a[0] / l, a[1] / l, a[2] / l} : Float3{0, 0, 1};
}
uint32_t bits(float v)
{
    return std::bit_cast<uint32_t>(v);
}

uint32_t pack_snorm(float x, float y)
{
    const auto one = [](float v) { return uint32_t(uint16_t(int16_t(std::lround(std::clamp(v, -1.f, 1.f) * 32767)))); };
    return one(x) | one(y) << 16;
}

// octahedral, as shaders/lib/surface.glsl reads it
uint32_t pack_normal(const Float3& n)
{
    const float sum = std::abs(n[0]) + std::abs(n[1]) + std::abs(n[2]);
    float x = n[0] / sum, y = n[1] / sum;
    if (n[2] < 0) {
        const float folded = (1 - std::abs(y)) * (x >= 0 ? 1 : -1);
        y = (1 - std::abs(x)) * (y >= 0 ? 1 : -1);
        x = folded;
    }
    return pack_snorm(x, y);
}

Float3 area_normal(const Mesh& m, size_t face)
{
    const auto& f = m.faces[face];
    return cross(minus(m.positions[f[1]], m.positions[f[0]]), minus(m.positions[f[2]], m.positions[f[0]]));
}

// faces that meet at a place, whatever the vertices are called there
class Neighbours {
  public:
    explicit Neighbours(const Mesh& m) : place_(m.positions.size())
    {
        std::vector<uint32_t> order(m.positions.size());
        std::iota(order.begin(), order.end(), 0u);
        std::ranges::sort(
            order, [&](uint32_t a, uint32_t b) { return std::pair(m.positions[a], a) < std::pair(m.positions[b], b); });
        uint32_t places = 0;
        for (size_t i = 0; i < order.size(); ++i)
            place_[order[i]] = i && m.positions[order[i]] == m.positions[order[i - 1]] ? places - 1 : places++;
        starts_.resize(places + 1);
        for (const auto& f : m.faces)
            for (uint32_t v : f)
                ++starts_[place_[v] + 1];
        std::partial_sum(starts_.begin(), starts_.end(), starts_.begin());
        std::vector<uint32_t> next(starts_.begin(), starts_.end() - 1);
        normals_.resize(m.faces.size() * 3);
        for (size_t f = 0; f < m.faces.size(); ++f)
            for (uint32_t v : m.faces[f])
                normals_[next[place_[v]]++] = area_normal(m, f);
    }

    // mean by area of those that bend little against `flat`
    Float3 normal(uint32_t vertex, const Float3& flat) const
    {
        Float3 sum{};
        for (uint32_t i = starts_[place_[vertex]]; i < starts_[place_[vertex] + 1]; ++i)
            if (dot(unit(normals_[i]), flat) > kCrease)
                for (size_t a = 0; a < 3; ++a)
                    sum[a] += normals_[i][a];
        return dot(sum, sum) > 0 ? unit(sum) : flat;
    }

  private:
    std::vector<uint32_t> place_, starts_;
    std::vector<Float3> normals_; // of faces, by place
};

// pictures a metre: root of the ratio of the areas
float texture_density(const std::array<std::array<float, 2>, 3>& uv, float area2)
{
    const float u1 = uv[1][0] - uv[0][0], v1 = uv[1][1] - uv[0][1], u2 = uv[2][0] - uv[0][0], v2 = uv[2][1] - uv[0][1];
    return area2 > 0 ? std::sqrt(std::abs(u1 * v2 - u2 * v1) / area2) : 0;
}

// source: the face's number in tables; owner: of the thing
void add_triangle(TraceTables& t, const Mesh& m, const Neighbours& around, uint32_t face, uint32_t source,
                  uint32_t owner)
{
    const auto& f = m.faces[face];
    const Float3 a = m.positions[f[0]], e1 = minus(m.positions[f[1]], a), e2 = minus(m.positions[f[2]], a);
    const uint32_t material = m.face_materials.empty() ? 0 : m.face_materials[face];
    const uint32_t label = m.face_labels.empty() ? kNoLabel : m.face_labels[face];
    t.triangles.push_back({bits(a[0]), bits(a[1]), bits(a[2]), source, bits(e1[0]), bits(e1[1]), bits(e1[2]), material,
                           bits(e2[0]), bits(e2[1]), bits(e2[2]), label | owner << 8});
    const Float3 area = area_normal(m, face), flat = unit(area);
    std::array<std::array<float, 2>, 3> uv{};
    if (!m.uvs.empty())
        uv = m.uvs[face];
    std::array<uint32_t, 3> n;
    for (size_t c = 0; c < 3; ++c)
        n[c] = pack_normal(around.normal(f[c], flat));
    t.corners.push_back({bits(uv[0][0]), bits(uv[0][1]), bits(uv[1][0]), bits(uv[1][1]), bits(uv[2][0]), bits(uv[2][1]),
                         n[0], n[1], n[2], bits(texture_density(uv, std::sqrt(dot(area, area)))), 0, 0});
}

struct LinearPicture {
    uint32_t width, height;
    std::vector<Float3> pixels;
};

float to_linear(float c)
{
    return c <= 0.04045f ? c / 12.92f : std::pow((c + 0.055f) / 1.055f, 2.4f);
}
uint32_t to_byte(float c)
{
    const float s = c <= 0.0031308f ? 12.92f * c : 1.055f * std::pow(c, 1 / 2.4f) - 0.055f;
    return uint32_t(std::lround(std::clamp(s, 0.f, 1.f) * 255));
}

LinearPicture halved(const LinearPicture& p)
{
    LinearPicture h{std::max(p.width / 2, 1u), std::max(p.height / 2, 1u), {}};
    for (uint32_t y = 0; y < h.height; ++y)
        for (uint32_t x = 0; x < h.width; ++x) {
            Float3 sum{};
            for (uint32_t k = 0; k < 4; ++k) {
                const uint32_t sx = std::min(2 * x + k % 2, p.width - 1), sy = std::min(2 * y + k / 2, p.height - 1);
                for (size_t c = 0; c < 3; ++c)
                    sum[c] += p.pixels[size_t(sy) * p.width + sx][c] / 4;
            }
            h.pixels.push_back(sum);
        }
    return h;
}

// all levels; returns how many
uint32_t add_picture(std::vector<uint32_t>& texels, const ImageRgb8& image)
{
    std::array<float, 256> linear;
    for (size_t i = 0; i < 256; ++i)
        linear[i] = to_linear(float(i) / 255);
    LinearPicture p{image.width, image.height, {}};
    for (size_t i = 0; i < image.pixels.size(); i += 3) {
        p.pixels.push_back({linear[image.pixels[i]], linear[image.pixels[i + 1]], linear[image.pixels[i + 2]]});
        texels.push_back(uint32_t(image.pixels[i]) | uint32_t(image.pixels[i + 1]) << 8 |
                         uint32_t(image.pixels[i + 2]) << 16);
    }
    uint32_t levels = 1;
    for (; p.width > 1 || p.height > 1; ++levels) {
        p = halved(p);
        for (const Float3& c : p.pixels)
            texels.push_back(to_byte(c[0]) | to_byte(c[1]) << 8 | to_byte(c[2]) << 16);
    }
    return levels;
}

void add_materials(TraceTables& t, const Mesh& mesh, std::span<const float> gloss)
{
    std::vector<std::array<uint32_t, 4>> pictures;
    for (const Texture& texture : mesh.textures) {
        const uint32_t first = uint32_t(t.texels.size());
        const uint32_t levels = add_picture(t.texels, texture.image);
        pictures.push_back({first, texture.image.width, texture.image.height, levels});
    }
    for (size_t i = 0; i < mesh.materials.size(); ++i) {
        const Material& m = mesh.materials[i];
        const auto picture = m.texture >= 0 ? pictures[size_t(m.texture)] : std::array<uint32_t, 4>{};
        t.materials.push_back({bits(m.color[0]), bits(m.color[1]), bits(m.color[2]), bits(gloss.empty() ? 0 : gloss[i]),
                               picture[0], picture[1], picture[2], picture[3]});
    }
    if (t.materials.empty())
        t.materials.push_back({bits(0.5f), bits(0.5f), bits(0.5f)});
    if (t.texels.empty())
        t.texels.push_back(0);
}

} // namespace

TraceTables trace_tables(const Mesh& whole, std::span<const float> gloss, std::span<const uint32_t> faces,
                         std::span<const uint32_t> owners)
{
    std::vector<uint32_t> chosen(faces.begin(), faces.end());
    const bool all = chosen.empty();
    OpaqueParts parts; // of a mesh that alpha cuts holes into
    const bool cut = has_transparency(whole);
    if (cut)
        parts = opaque_parts(whole);
    const Mesh& mesh = cut ? parts.mesh : whole;
    if (all || cut) {
        chosen.resize(mesh.faces.size());
        std::iota(chosen.begin(), chosen.end(), 0u);
    }
    if (cut && !all)
        std::erase_if(chosen, [&](uint32_t f) { return std::ranges::find(faces, parts.sources[f]) == faces.end(); });
    std::vector<std::array<uint32_t, 3>> corners;
    for (uint32_t f : chosen)
        corners.push_back(mesh.faces[f]);
    Bvh bvh = build_bvh(mesh.positions, corners);
    const Neighbours around(mesh);
    TraceTables t{.nodes = std::move(bvh.nodes)};
    t.triangles.reserve(chosen.size());
    t.corners.reserve(chosen.size());
    for (uint32_t i : bvh.order) {
        const uint32_t source = cut ? parts.sources[chosen[i]] : chosen[i];
        add_triangle(t, mesh, around, chosen[i], source, owners.empty() ? 0 : owners[source]);
    }
    add_materials(t, mesh, gloss);
    return t;
}

Result<DeviceTraceScene> DeviceTraceScene::create(Device& device, const TraceTables& t)
{
    DeviceTraceScene s;
    const uint64_t limit = std::min(device.limits().max_storage_range, device.limits().max_allocation);
    const auto declare = [&](DeviceTensor& slot, const auto& rows, DType dtype, const char* name) -> Status {
        const uint64_t bytes = std::as_bytes(std::span(rows)).size(), width = sizeof(rows[0]) / 4;
        if (bytes > limit)
            return fail(ErrorCode::out_of_memory,
                        "a scene of {} triangles and {} texels has a table of {} bytes; this device binds at most {}",
                        t.triangles.size(), t.texels.size(), bytes, limit);
        slot = s.memory_.tensor(std::max(uint32_t(rows.size()), 1u), uint32_t(width), dtype, name, uint32_t(width));
        return {};
    };
    SR_CHECK(declare(s.nodes_, t.nodes, DType::u32, "tree"));
    SR_CHECK(declare(s.triangles_, t.triangles, DType::f32, "triangles"));
    SR_CHECK(declare(s.corners_, t.corners, DType::u32, "corners"));
    SR_CHECK(declare(s.materials_, t.materials, DType::u32, "materials"));
    SR_CHECK(declare(s.texels_, t.texels, DType::u32, "texels"));
    SR_CHECK(s.memory_.allocate(device, "traced scene"));
    const auto write = [&](const DeviceTensor& slot, const auto& rows) {
        return rows.empty() ? Status{} : slot.write(device, rows);
    };
    SR_CHECK(write(s.nodes_, t.nodes));
    SR_CHECK(write(s.triangles_, t.triangles));
    SR_CHECK(write(s.corners_, t.corners));
    SR_CHECK(write(s.materials_, t.materials));
    SR_CHECK(write(s.texels_, t.texels));
    return s;
}

TraceScene DeviceTraceScene::in(Graph& g) const
{
    return {nodes_.in(g), triangles_.in(g), corners_.in(g), materials_.in(g), texels_.in(g)};
}

} // namespace semrover
