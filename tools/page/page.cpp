// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/page/page.h"

#include "engine/scene/palette.h"
#include "page_assets.h"

#include <cmath>
#include <map>

namespace semrover {

namespace {

using Values = std::map<std::string_view, std::string>;

// {{name}} becomes its value; values are not looked into
std::string fill(std::string_view text, const Values& values)
{
    std::string out;
    for (size_t at = 0;;) {
        const size_t open = text.find("{{", at);
        out += text.substr(at, open - at);
        if (open == std::string_view::npos)
            return out;
        const size_t close = text.find("}}", open);
        SR_ASSERT(close != std::string_view::npos, "a name of the page's template is not closed");
        const std::string_view name = text.substr(open + 2, close - open - 2);
        const auto value = values.find(name);
        SR_ASSERT(value != values.end(), "the page's template asks for {}", name);
        out += value->second;
        at = close + 2;
    }
}

// "a, b and c"
std::string listed(const std::vector<std::string>& names)
{
    std::string out;
    for (size_t i = 0; i < names.size(); ++i)
        out += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + names[i];
    return out;
}

std::string about_text(const PageContent& c)
{
    if (!c.about.empty())
        return c.about;
    const auto& [name, grid, hash, points] = c.scenes[0];
    std::string out = fmt::format("{} labelled voxels of {:g} m", counted(grid.cells.size()), grid.voxel_size);
    if (!points.centers)
        out += fmt::format(", with {} coloured points on their surfaces", counted(points.total));
    if (!c.pictures.names.empty())
        out += fmt::format("; {} {} of a drive through them, shown as {}", c.pictures.moments.size(),
                           c.pictures.moments.size() == 1 ? "moment" : "moments", listed(c.pictures.names));
    return out + ".";
}

std::string player_html(const PictureTable& pictures)
{
    const size_t moments = pictures.moments.size();
    std::string caption;
    if (moments < pictures.shared)
        caption = fmt::format("{} of {} moments. ", moments, counted(pictures.shared));
    if (pictures.names.size() > 1)
        caption += "Drag the line to compare two pictures of the same moment; the half-filled squares at a name put it "
                   "on that side. ";
    if (moments > 1)
        caption += "The arrow keys <kbd>&larr;</kbd> and <kbd>&rarr;</kbd> go from moment to moment.";
    return fill(page_assets::kPlayer, {{"caption", caption}});
}

std::string orbit_html(const PagePoints& points)
{
    std::string caption;
    if (points.centers)
        caption = "Each dot is the middle of a voxel. ";
    else if (points.count < points.total)
        caption = fmt::format("{} of {} points. ", counted(points.count), counted(points.total));
    caption += "Drag to turn, drag with the right button or two fingers to move, click and then scroll to come closer, "
               "double-click a place to look at it. With the keyboard: arrows, <kbd>+</kbd> and <kbd>&minus;</kbd>, "
               "<kbd>0</kbd> for the whole scene.";
    const std::string label = fmt::format("The scene as {} points, to be turned and zoomed", counted(points.count));
    return fill(page_assets::kOrbit, {{"caption", caption}, {"label", html_text(label)}});
}

std::string tables_html(const PageContent& c)
{
    const PageScene& scene = c.scenes[0];
    std::string out = "<section aria-labelledby=\"made-of\">\n<h2 id=\"made-of\">What it is made of</h2>\n"
                      "<div class=\"columns\">\n" +
                      class_table(scene.grid) + grid_facts(scene.grid, scene.xxh64) + "</div>\n</section>\n";
    if (c.runs.empty() && c.figures.empty())
        return out;
    out += "<section aria-labelledby=\"runs\">\n<h2 id=\"runs\">How it was made</h2>\n";
    if (!c.runs.empty())
        out += run_table(c.runs);
    for (const PageFigures& figures : c.figures)
        out += figure_table(figures);
    return out + "</section>\n";
}

double rounded(double value, double digits)
{
    return std::round(value * digits) / digits;
}

// x, y, z and where it looks
Json path_json(const CameraPath& path)
{
    Json list = Json::array();
    for (const CameraFrame& frame : path.frames) {
        if (frame.camera != path.frames[0].camera)
            continue;
        const Rigid m = frame.pose.camera_to_world();
        Json pose = Json::array();
        for (size_t axis = 0; axis < 3; ++axis)
            pose.push_back(rounded(m[4 * axis + 3], 1e3));
        for (size_t axis = 0; axis < 3; ++axis)
            pose.push_back(rounded(m[4 * axis + 2], 1e5));
        list.push_back(std::move(pose));
    }
    return list;
}

Json data_json(const PageContent& c)
{
    Json palette = Json::array(), sets = Json::array(), scenes = Json::array();
    for (const SemanticClass& entry : kPalette)
        palette.push_back({{"name", entry.name}, {"color", entry.color}});
    for (size_t s = 0; s < c.pictures.names.size(); ++s)
        sets.push_back({{"name", c.pictures.names[s]},
                        {"width", c.pictures.sizes[s].first},
                        {"height", c.pictures.sizes[s].second}});
    for (const auto& [name, grid, hash, p] : c.scenes)
        scenes.push_back({{"name", name},
                          {"count", p.count},
                          {"total", p.total},
                          {"low", p.low},
                          {"step", p.step},
                          {"diameter", p.diameter},
                          {"centers", p.centers}});
    return {{"palette", palette},
            {"sets", sets},
            {"moments", c.pictures.moments},
            {"scenes", scenes},
            {"path", path_json(c.path)}};
}

std::string payload_html(const PageContent& c)
{
    std::string out;
    for (size_t s = 0; s < c.scenes.size(); ++s)
        out += fmt::format("<script type=\"text/plain\" id=\"points-{}\">{}</script>\n", s,
                           base64(c.scenes[s].points.bytes));
    for (size_t s = 0; s < c.pictures.pictures.size(); ++s)
        for (size_t m = 0; m < c.pictures.moments.size(); ++m) {
            const Picture& picture = c.pictures.pictures[s][m];
            out += fmt::format("<script type=\"text/plain\" id=\"picture-{}-{}\" data-type=\"{}\">{}</script>\n", s, m,
                               picture.type, base64(picture.file));
        }
    return out;
}

std::string inputs_html(const PageContent& c)
{
    std::string out = "The file's points come from";
    for (size_t s = 0; s < c.scenes.size(); ++s)
        out += fmt::format("{} a grid with the XXH64 <span class=\"hash\">{}</span>{}", s ? " and" : "",
                           html_text(c.scenes[s].xxh64),
                           c.scenes.size() > 1 ? fmt::format(" (<bdi>{}</bdi>)", html_text(c.scenes[s].name)) : "");
    return out + ".";
}

} // namespace

std::string page_html(const PageContent& c)
{
    SR_ASSERT(!c.scenes.empty(), "a page without a scene");
    return fill(page_assets::kPage,
                {{"title", html_text(c.title)},
                 {"about", html_text(about_text(c))},
                 {"program", html_text(c.program)},
                 {"style", std::string(page_assets::kStyle)},
                 {"player", c.pictures.names.empty() ? "" : player_html(c.pictures)},
                 {"orbit", orbit_html(c.scenes[0].points)},
                 {"tables", tables_html(c)},
                 {"command", html_text(c.command, 20000)},
                 {"inputs", inputs_html(c)},
                 {"data", script_json(data_json(c))},
                 {"payload", payload_html(c)},
                 {"script", "(() => {\n\"use strict\";\n" + std::string(page_assets::kScript) + "})();"}});
}

} // namespace semrover
