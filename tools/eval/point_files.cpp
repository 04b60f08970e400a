// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/sample_files.h"

#include "engine/format/ply.h"
#include "engine/format/ply_reader.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr double kFarthest = 1e5; // metres

using Columns = std::array<const PlyProperty*, 3>;

bool complete(const Columns& columns)
{
    return std::ranges::all_of(columns, [](const PlyProperty* p) { return p && !p->is_list; });
}

// a colour of a file becomes scale * value + offset
struct ColorScale {
    Columns columns{};
    double scale = 0, offset = 0;
};

Result<ColorScale> color_scale(const PlyElement& vertices, std::string_view where)
{
    ColorScale c{{vertices.find("red"), vertices.find("green"), vertices.find("blue")}, 1, 0};
    if (!complete(c.columns)) {
        c = {{vertices.find("f_dc_0"), vertices.find("f_dc_1"), vertices.find("f_dc_2")}, double(kHarmonic0), 0.5};
        return complete(c.columns) ? c : ColorScale{};
    }
    double most = 0;
    for (const PlyProperty* column : c.columns)
        for (size_t i = 0; i < vertices.rows; ++i) {
            const double value = column->values[i];
            if (!(value >= 0 && value <= (column->is_float ? 1 : 65535)))
                return fail(ErrorCode::bad_input, "{}: vertex {}: {} is {}, expected {}", where, i, column->name, value,
                            column->is_float ? "0 to 1 of a float" : "0 to 255, or to 65535 of 16 bits");
            most = std::max(most, value);
        }
    if (!c.columns[0]->is_float)
        c.scale = most > 255 ? 1.0 / 65535 : 1.0 / 255;
    return c;
}

bool is_ply(const Path& path)
{
    std::string ending = path.extension().string();
    std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return char(std::tolower(c)); });
    return ending == ".ply";
}

} // namespace

Result<bool> is_cloud(const Path& path)
{
    if (!is_ply(path))
        return false;
    SR_TRY(const MappedFile file, MappedFile::open(path));
    const std::string_view text(reinterpret_cast<const char*>(file.bytes().data()), file.bytes().size());
    SR_TRY(const PlyHeader header, parse_ply_header(text, quote_path(path)));
    return std::ranges::none_of(
        header.elements, [](const PlyLayout& e) { return e.rows > 0 && (e.name == "face" || e.name == "tristrips"); });
}

Result<PointCloud> read_cloud(const Path& path)
{
    const std::string where = quote_path(path);
    SR_TRY(const bool cloud, is_cloud(path));
    if (!cloud)
        return fail(ErrorCode::bad_input, "{}: expected a cloud of points, a .ply without faces", where);
    SR_TRY(const PlyFile file, read_ply(path));
    const PlyElement* vertices = file.find("vertex");
    const Columns places =
        vertices ? Columns{vertices->find("x"), vertices->find("y"), vertices->find("z")} : Columns{};
    if (!complete(places))
        return fail(ErrorCode::bad_input, "{}: expected vertices with x, y and z", where);
    SR_TRY(const ColorScale color, color_scale(*vertices, where));
    PointCloud out;
    for (size_t i = 0; i < vertices->rows; ++i) {
        const std::array<double, 3> p = {places[0]->values[i], places[1]->values[i], places[2]->values[i]};
        if (!std::ranges::all_of(p, [](double v) { return std::isfinite(v); })) {
            ++out.dropped;
            continue;
        }
        out.positions.push_back(p);
        if (!color.columns[0])
            continue;
        auto& rgb = out.colors.emplace_back();
        for (size_t c = 0; c < 3; ++c)
            rgb[c] = float(std::clamp(color.columns[c]->values[i] * color.scale + color.offset, 0.0, 1.0));
    }
    if (out.positions.empty())
        return fail(ErrorCode::bad_input, "{}: no points", where);
    return out;
}

Result<PointFile> read_points(const Path& path)
{
    PointFile out;
    if (!is_ply(path)) {
        SR_TRY(const VoxelGrid grid, read_grid(path));
        if (!grid.has_points())
            return fail(ErrorCode::bad_input, "{}: a semantic grid without points", quote_path(path));
        out.points = points_of(grid);
        return out;
    }
    SR_TRY(PointCloud read, read_cloud(path));
    out.dropped = read.dropped;
    out.points.colors = std::move(read.colors);
    for (const auto& p : read.positions) {
        if (!std::ranges::all_of(p, [](double v) { return std::abs(v) <= kFarthest; }))
            return fail(ErrorCode::bad_input,
                        "{}: a point lies at ({:.6g}, {:.6g}, {:.6g}) m, expected within {:.0f} m of the origin: move "
                        "both sets there",
                        quote_path(path), p[0], p[1], p[2], kFarthest);
        out.points.positions.push_back({float(p[0]), float(p[1]), float(p[2])});
    }
    return out;
}

} // namespace semrover
