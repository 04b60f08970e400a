// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// OFF in text, with colours of vertices (COFF) or of faces. Source: the Geomview manual, "OFF: Object File Format",
// http://www.geomview.org/docs/html/OFF.html
#include "engine/format/file_colors.h"
#include "engine/mesh/mesh_readers.h"
#include "engine/mesh/word_lines.h"
#include "engine/scene/srgb.h"
#include "runtime/base/file.h"
#include "runtime/base/text_start.h"

#include <map>

namespace semrover {

namespace {

constexpr size_t kMaxFaceColors = 1 << 16;

using RawColor = std::array<float, 3>; // as the file counts it
constexpr RawColor kUncolored = {-1, -1, -1};

class OffReader {
  public:
    OffReader(std::string_view text, std::string where) : lines_(text), where_(std::move(where)) {}

    Result<FileMesh> read();

  private:
    template <typename... Args>
    tl::unexpected<Error> refuse(fmt::format_string<Args...> format, Args&&... args) const
    {
        return fail(ErrorCode::bad_input, "{}: line {}: {}", where_, lines_.number,
                    fmt::format(format, std::forward<Args>(args)...));
    }
    Status next_line(std::string_view expected);
    Status read_kind();
    Result<size_t> count_at(size_t word, size_t most);
    Result<RawColor> color_at(size_t word);
    Status read_vertex();
    Status read_face();
    Result<uint32_t> material_of(size_t word);
    Status decide_colors();

    WordLines lines_;
    std::string where_;
    Mesh mesh_;
    std::vector<std::array<double, 3>> positions_;
    size_t normals_ = 0; // words of a vertex behind its place
    bool colors_ = false, fractions_ = false;
    std::vector<RawColor> vertex_colors_;
    std::map<RawColor, uint32_t> materials_;
};

// that has words
Status OffReader::next_line(std::string_view expected)
{
    while (lines_.next())
        if (!lines_.words.empty())
            return {};
    return fail(ErrorCode::bad_input, "{}: ends where {} is expected; the file is cut", where_, expected);
}

// [C][N]OFF; the counts may follow on the same line
Status OffReader::read_kind()
{
    SR_CHECK(next_line("OFF"));
    const std::string_view kind = lines_.words[0];
    if (kind != "OFF" && kind != "COFF" && kind != "NOFF" && kind != "CNOFF")
        return refuse("expected OFF, COFF, NOFF or CNOFF, found {}", quote(kind, 40));
    colors_ = kind.starts_with('C');
    normals_ = kind.find('N') != std::string_view::npos ? 3 : 0;
    lines_.words.erase(lines_.words.begin());
    if (!lines_.words.empty() && lines_.words[0] == "BINARY")
        return refuse("binary OFF is not supported");
    return lines_.words.empty() ? next_line("the numbers of vertices and faces") : Status();
}

Result<size_t> OffReader::count_at(size_t word, size_t most)
{
    size_t value = 0;
    const std::string_view text = word < lines_.words.size() ? lines_.words[word] : "";
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (text.empty() || error != std::errc() || end != text.data() + text.size() || value > most)
        return refuse("expected a number up to {}, found {}", most, quote(text, 40));
    return value;
}

// whole numbers up to 255, or floats, of which one in the file has a point
Result<RawColor> OffReader::color_at(size_t word)
{
    RawColor color{};
    for (size_t a = 0; a < 3; ++a) {
        const std::string_view text = lines_.words[word + a];
        SR_TRY(color[a], number_of(text, where_, lines_.number));
        if (!(color[a] >= 0))
            return refuse("the colour {}, expected 0 or more", color[a]);
        fractions_ |= text.find_first_of(".eE") != std::string_view::npos;
    }
    return color;
}

Status OffReader::decide_colors()
{
    ColorScale scale(fractions_ ? ColorType::real : ColorType::byte);
    for (size_t i = 0; i < vertex_colors_.size(); ++i)
        for (const float value : vertex_colors_[i])
            scale.see(double(value), i);
    for (const auto& [color, material] : materials_)
        for (const float value : color)
            if (color != kUncolored)
                scale.see(double(value), material);
    SR_CHECK(scale.decide(where_, mesh_.warnings));
    for (const RawColor& color : vertex_colors_)
        mesh_.colors.push_back({scale.byte_of(color[0]), scale.byte_of(color[1]), scale.byte_of(color[2])});
    for (const auto& [color, material] : materials_)
        for (size_t a = 0; a < 3; ++a)
            mesh_.materials[material].color[a] =
                color == kUncolored ? 1 : float(linear_of_srgb(scale.byte_of(color[a]) / 255.0));
    return {};
}

Status OffReader::read_vertex()
{
    SR_CHECK(next_line("a vertex"));
    const size_t expected = 3 + normals_ + (colors_ ? 3 : 0);
    if (lines_.words.size() < expected)
        return refuse("a vertex of {} numbers, expected {}", lines_.words.size(), expected);
    std::array<double, 3> p{};
    for (size_t a = 0; a < 3; ++a) {
        SR_TRY(p[a], number_of(lines_.words[a], where_, lines_.number));
    }
    positions_.push_back(p);
    if (colors_) {
        SR_TRY(vertex_colors_.emplace_back(), color_at(3 + normals_));
    }
    return {};
}

// of a face's colour, its first word; one number alone is a place in a map that the file does not have
Result<uint32_t> OffReader::material_of(size_t word)
{
    RawColor color = kUncolored;
    if (lines_.words.size() >= word + 3) {
        SR_TRY(color, color_at(word));
    }
    const auto [entry, is_new] = materials_.try_emplace(color, uint32_t(mesh_.materials.size()));
    if (!is_new)
        return entry->second;
    if (mesh_.materials.size() >= kMaxFaceColors)
        return refuse("more than {} colours of faces", kMaxFaceColors);
    mesh_.materials.emplace_back();
    return entry->second;
}

Status OffReader::read_face()
{
    SR_CHECK(next_line("a face"));
    SR_TRY(const size_t corners, count_at(0, kMaxFaceCorners));
    if (corners < 3 || lines_.words.size() < corners + 1)
        return refuse("a face of {} corners with {} numbers behind it", corners, lines_.words.size() - 1);
    std::vector<uint32_t> indices;
    std::vector<std::array<double, 3>> positions;
    for (size_t i = 1; i <= corners; ++i) {
        SR_TRY(const size_t vertex, count_at(i, positions_.size() - 1));
        indices.push_back(uint32_t(vertex));
        positions.push_back(positions_[vertex]);
    }
    SR_TRY(const uint32_t material, material_of(corners + 1));
    for (const auto& t : triangulated(positions)) {
        mesh_.faces.push_back({indices[t[0]], indices[t[1]], indices[t[2]]});
        mesh_.face_materials.push_back(material);
    }
    if (mesh_.faces.size() > kMaxMeshElements)
        return refuse("more than {} triangles", kMaxMeshElements);
    return {};
}

Result<FileMesh> OffReader::read()
{
    SR_CHECK(read_kind());
    SR_TRY(const size_t vertices, count_at(0, kMaxMeshElements));
    SR_TRY(const size_t faces, count_at(1, kMaxMeshElements));
    if (vertices == 0)
        return refuse("no vertices");
    for (size_t i = 0; i < vertices; ++i) // nothing is reserved: lines that are there fill memory
        SR_CHECK(read_vertex());
    for (size_t i = 0; i < faces; ++i)
        SR_CHECK(read_face());
    SR_CHECK(decide_colors());
    if (materials_.size() == 1 && materials_.contains(kUncolored)) {
        mesh_.materials.clear();
        mesh_.face_materials.clear();
    }
    return FileMesh{std::move(mesh_), std::move(positions_)};
}

} // namespace

Result<FileMesh> read_off(const Path& path)
{
    SR_TRY(const MappedFile file, MappedFile::open(path));
    const std::string_view bytes(reinterpret_cast<const char*>(file.bytes().data()), file.bytes().size());
    SR_TRY(const std::string_view text, text_after_mark(bytes, quote_path(path)));
    return OffReader(text, quote_path(path)).read();
}

} // namespace semrover
