// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/mesh.h"

#include "engine/scene/palette.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr float kLargest = 1e6f; // metres, and texture coordinates

Status check_sizes(const Mesh& m, std::string_view where)
{
    const size_t v = m.positions.size(), f = m.faces.size();
    if (f == 0)
        return fail(ErrorCode::bad_input, "{}: the mesh has no faces", where);
    const auto check = [&](size_t found, size_t expected, const char* what) -> Status {
        if (found && found != expected)
            return fail(ErrorCode::bad_input, "{}: arrays disagree: {} {}, expected {}", where, found, what, expected);
        return {};
    };
    SR_CHECK(check(m.colors.size(), v, "vertex colours"));
    SR_CHECK(check(m.alphas.size(), v, "vertices with an alpha"));
    SR_CHECK(check(m.uvs.size(), f, "faces with texture coordinates"));
    SR_CHECK(check(m.face_materials.size(), f, "faces with a material"));
    return check(m.face_labels.size(), f, "faces with a label");
}

template <size_t N>
bool in_range(const std::array<float, N>& values)
{
    for (const float v : values)
        if (!(std::abs(v) <= kLargest)) // true for NaN
            return false;
    return true;
}

Status check_numbers(const Mesh& m, std::string_view where)
{
    for (size_t i = 0; i < m.positions.size(); ++i)
        if (!in_range(m.positions[i]))
            return fail(ErrorCode::bad_input, "{}: vertex {} is at ({}, {}, {}), expected numbers within 1e6", where, i,
                        m.positions[i][0], m.positions[i][1], m.positions[i][2]);
    for (size_t i = 0; i < m.uvs.size(); ++i)
        for (const auto& uv : m.uvs[i])
            if (!in_range(uv))
                return fail(ErrorCode::bad_input,
                            "{}: face {} has the texture coordinates ({}, {}), expected numbers within 1e6", where, i,
                            uv[0], uv[1]);
    return {};
}

Status check_indices(const Mesh& m, std::string_view where)
{
    for (size_t i = 0; i < m.faces.size(); ++i)
        for (const uint32_t v : m.faces[i])
            if (v >= m.positions.size())
                return fail(ErrorCode::bad_input, "{}: face {} refers to vertex {}, the mesh has {}", where, i, v,
                            m.positions.size());
    for (size_t i = 0; i < m.face_materials.size(); ++i)
        if (m.face_materials[i] >= m.materials.size())
            return fail(ErrorCode::bad_input, "{}: face {} refers to material {}, the mesh has {}", where, i,
                        m.face_materials[i], m.materials.size());
    for (size_t i = 0; i < m.materials.size(); ++i)
        for (const int32_t t : {m.materials[i].texture, m.materials[i].label_texture, m.materials[i].alpha_texture})
            if (t < -1 || t >= int64_t(m.textures.size()))
                return fail(ErrorCode::bad_input, "{}: material {} refers to texture {}, the mesh has {}", where, i, t,
                            m.textures.size());
    return {};
}

Status check_materials(const Mesh& m, std::string_view where)
{
    for (size_t i = 0; i < m.materials.size(); ++i)
        for (const float c : m.materials[i].color)
            if (!(c >= 0 && c <= 1))
                return fail(ErrorCode::bad_input, "{}: material {} has the colour {}, expected 0 to 1", where, i, c);
    for (size_t i = 0; i < m.textures.size(); ++i) {
        const ImageRgb8& image = m.textures[i].image;
        if (image.width < 1 || image.height < 1 || image.width > kMaxImageSide || image.height > kMaxImageSide ||
            image.pixels.size() != size_t(image.width) * image.height * 3)
            return fail(ErrorCode::bad_input, "{}: texture {} has {} x {} pixels in {} bytes", where, i, image.width,
                        image.height, image.pixels.size());
        const size_t alphas = m.textures[i].alpha.size();
        if (alphas && alphas != size_t(image.width) * image.height)
            return fail(ErrorCode::bad_input, "{}: texture {} of {} x {} pixels has {} values of alpha", where, i,
                        image.width, image.height, alphas);
    }
    return {};
}

Status check_labels(const Mesh& m, std::string_view where)
{
    std::array<size_t, 256> counts{};
    for (const uint8_t label : m.face_labels)
        ++counts[label];
    std::string unknown;
    for (size_t label = kClassCount; label < kNoLabel; ++label)
        if (counts[label])
            unknown += fmt::format("{}{} ({} faces)", unknown.empty() ? "" : ", ", label, counts[label]);
    if (!unknown.empty())
        return fail(ErrorCode::bad_input, "{}: unknown labels, expected 0 to {}: {}", where, kClassCount - 1, unknown);
    return {};
}

} // namespace

double face_area(const Mesh& mesh, size_t face)
{
    std::array<double, 3> u, v;
    const auto& f = mesh.faces[face];
    for (size_t a = 0; a < 3; ++a) {
        u[a] = double(mesh.positions[f[1]][a]) - mesh.positions[f[0]][a];
        v[a] = double(mesh.positions[f[2]][a]) - mesh.positions[f[0]][a];
    }
    return std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2;
}

void add_warning(std::vector<std::string>& warnings, std::string line)
{
    constexpr size_t kMost = 12;
    if (warnings.size() < kMost && std::ranges::find(warnings, line) == warnings.end())
        warnings.push_back(std::move(line));
    if (warnings.size() == kMost)
        warnings.back() = "there are more warnings of this mesh, which are left out";
}

Status check_mesh(const Mesh& mesh, std::string_view where)
{
    SR_CHECK(check_sizes(mesh, where));
    SR_CHECK(check_numbers(mesh, where));
    SR_CHECK(check_indices(mesh, where));
    SR_CHECK(check_materials(mesh, where));
    return check_labels(mesh, where);
}

} // namespace semrover
