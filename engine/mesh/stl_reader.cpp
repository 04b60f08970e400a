// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// STL, binary and text. Source: 3D Systems, "StereoLithography Interface Specification", 1989
#include "engine/mesh/mesh_readers.h"
#include "engine/mesh/word_lines.h"
#include "runtime/base/file.h"
#include "runtime/base/text_start.h"

#include <cstring>

namespace semrover {

namespace {

constexpr size_t kStlHeader = 84, kStlFacet = 50; // bytes; a facet is normal, three corners, and two bytes unused
constexpr size_t kMaxSolids = 1 << 16;

uint32_t count_in(std::span<const std::byte> file)
{
    uint32_t count = 0;
    std::memcpy(&count, file.data() + kStlHeader - 4, 4);
    return count;
}

// note: headers of binary files may begin with anything, with "solid", too; their length shows which they are
bool has_binary_length(std::span<const std::byte> file)
{
    return file.size() >= kStlHeader && file.size() == kStlHeader + kStlFacet * uint64_t(count_in(file));
}

Result<FileMesh> read_binary_stl(std::span<const std::byte> file, const std::string& where)
{
    const uint64_t facets = count_in(file), room = (file.size() - kStlHeader) / kStlFacet;
    if (facets > room)
        return fail(ErrorCode::bad_input, "{}: says it has {} triangles, there is room for {}; the file is cut", where,
                    facets, room);
    if (3 * facets > kMaxMeshElements)
        return fail(ErrorCode::bad_input, "{}: {} triangles, at most {} are supported", where, facets,
                    kMaxMeshElements / 3);
    FileMesh out;
    out.positions.resize(3 * facets);
    out.mesh.faces.resize(facets);
    for (uint32_t f = 0; f < facets; ++f) {
        std::array<float, 9> corners;
        std::memcpy(corners.data(), file.data() + kStlHeader + f * kStlFacet + 12, 36);
        for (size_t i = 0; i < 9; ++i)
            out.positions[3 * f + i / 3][i % 3] = double(corners[i]);
        out.mesh.faces[f] = {3 * f, 3 * f + 1, 3 * f + 2};
    }
    return out;
}

// a solid's name is a material's, so that it may say a class
Result<FileMesh> read_text_stl(std::string_view text, const std::string& where)
{
    FileMesh out;
    Mesh& mesh = out.mesh;
    size_t facet = 0; // its first corner
    for (WordLines lines(text); lines.next();) {
        const std::string_view key = lines.words.empty() ? "" : lines.words[0];
        const auto refuse = [&](const auto& what) {
            return fail(ErrorCode::bad_input, "{}: line {}: {}", where, lines.number, what);
        };
        if (key == "solid") {
            if (mesh.materials.size() >= kMaxSolids)
                return refuse(fmt::format("more than {} solids", kMaxSolids));
            mesh.materials.push_back({.name = std::string(lines.rest(1))});
        } else if (key == "vertex") {
            if (lines.words.size() != 4)
                return refuse(fmt::format("a vertex of {} numbers, expected 3", lines.words.size() - 1));
            std::array<double, 3> p{};
            for (size_t a = 0; a < 3; ++a) {
                SR_TRY(p[a], number_of(lines.words[a + 1], where, lines.number));
            }
            out.positions.push_back(p);
        } else if (key == "endfacet") {
            const auto first = uint32_t(facet);
            if (out.positions.size() != facet + 3)
                return refuse(fmt::format("a facet of {} vertices, expected 3", out.positions.size() - facet));
            if (out.positions.size() > kMaxMeshElements || mesh.materials.empty())
                return refuse(mesh.materials.empty() ? "a facet in front of the first solid" : "too many facets");
            mesh.faces.push_back({first, first + 1, first + 2});
            mesh.face_materials.push_back(uint32_t(mesh.materials.size() - 1));
            facet += 3;
        } else if (key != "" && key != "facet" && key != "outer" && key != "endloop" && key != "endsolid") {
            return refuse(fmt::format("expected STL, found {}", quote(key, 40)));
        }
    }
    if (out.positions.size() != facet)
        return fail(ErrorCode::bad_input, "{}: ends within a facet; the file is cut", where);
    return out;
}

} // namespace

Result<FileMesh> read_stl(const Path& path)
{
    const std::string where = quote_path(path);
    SR_TRY(const MappedFile file, MappedFile::open(path));
    const std::string_view bytes(reinterpret_cast<const char*>(file.bytes().data()), file.bytes().size());
    if (has_binary_length(file.bytes()))
        return read_binary_stl(file.bytes(), where);
    SR_TRY(const std::string_view text, text_after_mark(bytes, where));
    if (bytes.size() >= kStlHeader && !text.starts_with("solid"))
        return read_binary_stl(file.bytes(), where); // which says what it lacks
    if (!text.starts_with("solid"))
        return fail(ErrorCode::bad_input, "{}: expected STL, found {} bytes of something else", where, text.size());
    return read_text_stl(text, where);
}

} // namespace semrover
