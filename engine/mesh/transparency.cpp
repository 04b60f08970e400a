// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/transparency.h"

#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace semrover {

namespace {

constexpr float kSlack = 1e-6f;     // of alpha that was rounded
constexpr double kPieceEdge = 0.02; // metres
constexpr double kMostPieces = 1 << 21;

const Material* material_of(const Mesh& m, size_t face)
{
    return m.face_materials.empty() ? nullptr : &m.materials[m.face_materials[face]];
}

const Texture* alpha_of(const Mesh& m, const Material& material)
{
    const bool textured = material.alpha_texture >= 0 && !m.uvs.empty();
    const Texture* t = textured ? &m.textures[size_t(material.alpha_texture)] : nullptr;
    return t && !t->alpha.empty() ? t : nullptr;
}

uint32_t wrapped(double x, TextureWrap wrap, uint32_t size)
{
    if (wrap == TextureWrap::clamp)
        x = std::clamp(x, 0.0, 1.0);
    else if (wrap == TextureWrap::mirror)
        x = 1 - std::abs(x - 2 * std::floor(x / 2) - 1);
    else
        x -= std::floor(x);
    return std::min(uint32_t(x * size), size - 1);
}

float texel_alpha(const Texture& t, double u, double v)
{
    const ImageRgb8& i = t.image;
    return float(t.alpha[size_t(wrapped(v, t.wrap_v, i.height)) * i.width + wrapped(u, t.wrap_u, i.width)]) / 255;
}

struct Range {
    float low = 1, high = 1;
};

// of each texture
std::vector<Range> ranges_of(const Mesh& m)
{
    std::vector<Range> ranges;
    for (const Texture& t : m.textures) {
        Range& r = ranges.emplace_back();
        if (t.alpha.empty())
            continue;
        const auto [low, high] = std::ranges::minmax(t.alpha);
        r = {float(low) / 255, float(high) / 255};
    }
    return ranges;
}

Range range_of_vertices(const Mesh& m, size_t face)
{
    if (m.alphas.empty())
        return {};
    const auto& f = m.faces[face];
    const auto [low, high] = std::minmax({m.alphas[f[0]], m.alphas[f[1]], m.alphas[f[2]]});
    return {float(low) / 255, float(high) / 255};
}

template <typename T>
void keep_chosen(std::vector<T>& values, const std::vector<bool>& keep)
{
    if (values.empty())
        return;
    size_t to = 0;
    for (size_t i = 0; i < keep.size(); ++i)
        if (keep[i])
            values[to++] = values[i];
    values.resize(to);
}

std::string text_of(const std::map<uint32_t, double>& areas, const Mesh& m)
{
    std::string text;
    size_t listed = 0;
    for (const auto& [material, area] : areas)
        if (++listed <= 5)
            text +=
                fmt::format("{}{} ({:.4g} m^2)", text.empty() ? "" : ", ", quote(m.materials[material].name, 60), area);
    return areas.size() > 5 ? text + fmt::format(" and {} more", areas.size() - 5) : text;
}

struct Piece {
    std::array<std::array<double, 3>, 3> corners, weights; // metres; of the face's corners
};

// halves along the longest edge until pieces are small, and keeps those whose middle has a surface
class Cutter {
  public:
    Cutter(const Mesh& mesh, double edge) : mesh_(mesh), edge_(edge) {}

    std::vector<Piece> cut(size_t face)
    {
        face_ = face;
        kept_.clear();
        Piece whole{{}, {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}};
        for (size_t c = 0; c < 3; ++c)
            for (size_t a = 0; a < 3; ++a)
                whole.corners[c][a] = mesh_.positions[mesh_.faces[face][c]][a];
        split(whole, 0);
        return std::move(kept_);
    }

  private:
    void split(const Piece& p, int depth)
    {
        size_t longest = 0;
        double most = -1;
        for (size_t i = 0; i < 3; ++i) {
            const auto &a = p.corners[i], &b = p.corners[(i + 1) % 3];
            const double length = std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
            if (length > most) {
                most = length;
                longest = i;
            }
        }
        if (most <= edge_ || depth > 44) {
            std::array<double, 3> middle{};
            for (const auto& w : p.weights)
                for (size_t k = 0; k < 3; ++k)
                    middle[k] += w[k] / 3;
            if (has_surface(mesh_, face_, middle))
                kept_.push_back(p);
            return;
        }
        const size_t next = (longest + 1) % 3;
        for (const size_t replaced : {next, longest}) {
            Piece half = p;
            for (size_t k = 0; k < 3; ++k) {
                half.corners[replaced][k] = (p.corners[longest][k] + p.corners[next][k]) / 2;
                half.weights[replaced][k] = (p.weights[longest][k] + p.weights[next][k]) / 2;
            }
            split(half, depth + 1);
        }
    }

    const Mesh& mesh_;
    double edge_;
    size_t face_ = 0;
    std::vector<Piece> kept_;
};

void add_piece(Mesh& to, const Mesh& from, size_t face, const Piece& piece)
{
    const auto first = uint32_t(to.positions.size());
    for (size_t c = 0; c < 3; ++c) {
        const auto& p = piece.corners[c];
        to.positions.push_back({float(p[0]), float(p[1]), float(p[2])});
        if (from.colors.empty())
            continue;
        std::array<double, 3> color{};
        for (size_t k = 0; k < 3; ++k)
            for (size_t a = 0; a < 3; ++a)
                color[a] += piece.weights[c][k] * from.colors[from.faces[face][k]][a];
        to.colors.push_back({uint8_t(std::lround(color[0])), uint8_t(std::lround(color[1])), //
                             uint8_t(std::lround(color[2]))});
    }
    to.faces.push_back({first, first + 1, first + 2});
    if (from.uvs.empty())
        return;
    auto& uv = to.uvs.emplace_back();
    for (size_t c = 0; c < 3; ++c)
        for (size_t a = 0; a < 2; ++a) {
            double sum = 0;
            for (size_t k = 0; k < 3; ++k)
                sum += piece.weights[c][k] * from.uvs[face][k][a];
            uv[c][a] = float(sum);
        }
}

void drop_unused_vertices(Mesh& m)
{
    std::vector<bool> used(m.positions.size());
    for (const auto& f : m.faces)
        for (const uint32_t v : f)
            used[v] = true;
    std::vector<uint32_t> number(used.size());
    for (uint32_t v = 0, next = 0; v < used.size(); ++v)
        if (used[v])
            number[v] = next++;
    keep_chosen(m.positions, used);
    keep_chosen(m.colors, used);
    for (auto& f : m.faces)
        for (uint32_t& v : f)
            v = number[v];
}

// whose alpha is not the same all over
bool is_mixed(const Mesh& m, size_t face)
{
    const Material* material = material_of(m, face);
    return material && material->alpha_cutoff > 0 && (alpha_of(m, *material) || !m.alphas.empty());
}

} // namespace

bool has_transparency(const Mesh& mesh)
{
    return std::ranges::any_of(mesh.materials, [](const Material& m) { return m.alpha_cutoff > 0; });
}

float alpha_threshold(const Material& m)
{
    if (!(m.alpha_cutoff > 0))
        return 0;
    return m.alpha > 0 ? std::max(m.alpha_cutoff / m.alpha - kSlack, 1e-9f) : 2.f;
}

bool has_surface(const Mesh& m, size_t face, const std::array<double, 3>& weights)
{
    const Material* material = material_of(m, face);
    const float threshold = material ? alpha_threshold(*material) : 0;
    if (!(threshold > 0))
        return true;
    double alpha = 1;
    if (!m.alphas.empty()) {
        alpha = 0;
        for (size_t c = 0; c < 3; ++c)
            alpha += weights[c] * m.alphas[m.faces[face][c]] / 255;
    }
    if (const Texture* t = alpha_of(m, *material)) {
        double uv[2] = {0, 0};
        for (size_t c = 0; c < 3; ++c)
            for (size_t a = 0; a < 2; ++a)
                uv[a] += weights[c] * m.uvs[face][c][a];
        alpha *= texel_alpha(*t, uv[0], uv[1]);
    }
    return alpha >= threshold;
}

Status drop_transparent(Mesh& m, std::string_view where)
{
    if (!has_transparency(m) || m.face_materials.empty())
        return {};
    const std::vector<Range> ranges = ranges_of(m);
    std::vector<bool> keep(m.faces.size(), true), mixed(m.materials.size());
    std::map<uint32_t, double> areas; // that are left out, by material
    for (size_t f = 0; f < m.faces.size(); ++f) {
        const uint32_t index = m.face_materials[f];
        const Material& material = m.materials[index];
        const float threshold = alpha_threshold(material);
        if (!(threshold > 0))
            continue;
        const Range vertices = range_of_vertices(m, f);
        const Range texels = alpha_of(m, material) ? ranges[size_t(material.alpha_texture)] : Range{};
        keep[f] = vertices.high * texels.high >= threshold;
        mixed[index] = mixed[index] || (keep[f] && vertices.low * texels.low < threshold);
        if (!keep[f])
            areas[index] += face_area(m, f);
    }
    for (size_t i = 0; i < mixed.size(); ++i)
        if (!mixed[i])
            m.materials[i].alpha_cutoff = 0;
    if (areas.empty())
        return {};
    const std::string text = text_of(areas, m);
    keep_chosen(m.faces, keep);
    keep_chosen(m.uvs, keep);
    keep_chosen(m.face_materials, keep);
    keep_chosen(m.face_labels, keep);
    if (m.faces.empty())
        return fail(ErrorCode::bad_input, "{}: all of it is transparent: {}; `opaque` makes it a surface", where, text);
    add_warning(m.warnings, fmt::format("{}: transparent, and so no surface: {}; `opaque` makes it one", where, text));
    return {};
}

OpaqueParts opaque_parts(const Mesh& m)
{
    double area = 0;
    for (size_t f = 0; f < m.faces.size(); ++f)
        area += is_mixed(m, f) ? face_area(m, f) : 0;
    // a piece that bisection makes has a quarter to a half of the square of its longest edge, which is more than half
    // of what is allowed
    Cutter cutter(m, std::max(kPieceEdge, std::sqrt(16 * area / kMostPieces)));
    OpaqueParts out;
    out.mesh.origin = m.origin;
    out.mesh.positions = m.positions;
    out.mesh.colors = m.colors;
    out.mesh.materials = m.materials;
    out.mesh.textures = m.textures;
    for (uint32_t f = 0; f < m.faces.size(); ++f) {
        size_t pieces = 1;
        if (is_mixed(m, f)) {
            const std::vector<Piece> kept = cutter.cut(f);
            pieces = kept.size();
            for (const Piece& piece : kept)
                add_piece(out.mesh, m, f, piece);
        } else {
            out.mesh.faces.push_back(m.faces[f]);
            if (!m.uvs.empty())
                out.mesh.uvs.push_back(m.uvs[f]);
        }
        out.sources.resize(out.sources.size() + pieces, f);
    }
    for (const uint32_t f : out.sources) {
        if (!m.face_materials.empty())
            out.mesh.face_materials.push_back(m.face_materials[f]);
        if (!m.face_labels.empty())
            out.mesh.face_labels.push_back(m.face_labels[f]);
    }
    for (Material& material : out.mesh.materials)
        material.alpha_cutoff = 0;
    drop_unused_vertices(out.mesh);
    return out;
}

} // namespace semrover
