// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/page/page.h"

#include "engine/scene/palette.h"
#include "engine/splat/bounds.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <set>
#include <span>

namespace semrover {

namespace {

constexpr JsonLimits kLimits{.bytes = 1u << 20, .depth = 8, .values = 4096};

// rows of a table of runs that are worth a look, in this order
constexpr std::array kSettings = {"device",         "driver",   "precision",     "sampler", "steps",
                                  "guidance_scale", "strategy", "jump_n_sample", "seed",    "version"};
constexpr std::array kResults = {
    "cells", "regions", "frames", "metres", "seconds", "planned_device_bytes", "peak_device_bytes"};

std::string text_of(const Json& value)
{
    if (value.is_boolean())
        return value.get<bool>() ? "yes" : "no";
    if (value.is_null())
        return "none";
    return value.is_string() ? value.get<std::string>() : json_text(value);
}

std::string size_text(double bytes)
{
    for (const char* unit : {"bytes", "KiB", "MiB"}) {
        if (bytes < 1024)
            return fmt::format("{:.{}f} {}", bytes, *unit == 'b' || bytes >= 100 ? 0 : 1, unit);
        bytes /= 1024;
    }
    return fmt::format("{:.{}f} GiB", bytes, bytes >= 100 ? 0 : 2);
}

std::string time_text(double seconds)
{
    if (seconds < 60)
        return fmt::format("{:.1f} s", seconds);
    const auto whole = uint64_t(seconds + 0.5);
    if (whole < 3600)
        return fmt::format("{} min {:02} s", whole / 60, whole % 60);
    return fmt::format("{} h {:02} min", whole / 3600, whole % 3600 / 60);
}

// a number that is a measure gets its unit; the file's own digits stay in the title
std::string value_html(std::string_view key, const Json& value, bool result)
{
    const std::string plain = html_text(text_of(value));
    std::string shown;
    if (value.is_number() && value.get<double>() >= 0 && value.get<double>() < 1e15) {
        if (key.ends_with("_bytes"))
            shown = size_text(value.get<double>());
        else if (key == "seconds")
            shown = time_text(value.get<double>());
        else if (result && value.is_number_unsigned())
            shown = counted(value.get<uint64_t>());
    }
    if (!shown.empty())
        return fmt::format("<span title=\"{}\">{}</span>", plain, shown);
    return fmt::format("<bdi>{}</bdi>", plain);
}

// what value_html() makes of it: bytes are memory, seconds a time
std::string label_html(std::string_view key)
{
    if (key == "seconds")
        return "time";
    std::string words(key);
    if (key.ends_with("_bytes"))
        words.replace(words.size() - 5, 5, "memory");
    std::ranges::replace(words, '_', ' ');
    return html_text(words, 200);
}

struct Row {
    bool result;
    std::string key;
};

// a column's value of a row, none if it has none
const Json* find(const PageRun& run, const Row& row)
{
    const Json& side = row.result ? run.results : run.settings;
    const auto found = side.find(row.key);
    return found == side.end() ? nullptr : &*found;
}

void append_row(std::string& out, const Row& row, const std::vector<PageRun>& runs)
{
    out += fmt::format("<tr><th scope=\"row\">{}</th>", label_html(row.key));
    for (const PageRun& run : runs) {
        const Json* value = find(run, row);
        out += fmt::format("<td>{}</td>", value ? value_html(row.key, *value, row.result) : "");
    }
    out += "</tr>\n";
}

std::string head(const std::vector<PageRun>& runs)
{
    std::string out = "<thead><tr><th></th>";
    for (const PageRun& run : runs)
        out += fmt::format("<th scope=\"col\"><bdi>{}</bdi>{}</th>", html_text(run.command, 200),
                           run.state == "finished" ? "" : fmt::format(" ({})", html_text(run.state, 200)));
    return out + "</tr></thead>\n";
}

// "a / b / c" for what is nested; lists count from 1
void flatten(const Json& value, const std::string& key, Json& out)
{
    if (value.is_structured() && !value.empty()) {
        size_t i = 0;
        for (const auto& [name, child] : value.items()) {
            const std::string own = value.is_array() ? std::to_string(++i) : name;
            flatten(child, key.empty() ? own : key + " / " + own, out);
        }
    } else if (!value.is_structured()) {
        out[key] = value;
    }
}

void add_rows(std::vector<Row>& rows, const std::vector<PageRun>& runs, bool result, std::span<const char* const> keys)
{
    for (const char* key : keys)
        if (std::ranges::any_of(runs, [&](const PageRun& run) { return find(run, {result, key}); }))
            rows.push_back({result, key});
}

std::vector<Row> other_rows(const std::vector<PageRun>& runs, const std::vector<Row>& shown)
{
    std::set<std::pair<bool, std::string>> keys;
    for (const PageRun& run : runs)
        for (const bool result : {false, true})
            for (const auto& [key, value] : (result ? run.results : run.settings).items())
                keys.emplace(result, key);
    for (const Row& row : shown)
        keys.erase({row.result, row.key});
    std::vector<Row> rows;
    for (const auto& [result, key] : keys)
        rows.push_back({result, key});
    return rows;
}

void append_fact(std::string& out, std::string_view name, std::string_view html)
{
    out += fmt::format("<dt>{}</dt><dd>{}</dd>\n", html_text(name, 200), html);
}

} // namespace

std::string class_table(const VoxelGrid& grid)
{
    std::array<uint64_t, kClassCount> counts{};
    for (const uint8_t label : grid.labels)
        ++counts[label];
    std::vector<size_t> order(kClassCount);
    std::iota(order.begin(), order.end(), size_t(0));
    std::ranges::stable_sort(order, std::greater(), [&](size_t i) { return counts[i]; });
    std::string out = "<table class=\"classes\"><thead><tr><th scope=\"col\">Class</th><th></th>"
                      "<th scope=\"col\" class=\"number\">Voxels</th><th scope=\"col\" class=\"number\">Share</th></tr>"
                      "</thead>\n<tbody>\n";
    for (const size_t i : order) {
        if (counts[i] == 0)
            break;
        const auto& [name, c] = kPalette[i];
        const std::string color = fmt::format("background:rgb({},{},{})", c[0], c[1], c[2]);
        out += fmt::format("<tr><th scope=\"row\"><span class=\"swatch\" style=\"{}\"></span>{}</th><td class=\"bar\">"
                           "<span style=\"{};width:{:.2f}%\"></span></td><td class=\"number\">{}</td>"
                           "<td class=\"number\">{:.1f}&#8239;%</td></tr>\n",
                           color, name, color, 100.0 * double(counts[i]) / double(counts[order[0]]), counted(counts[i]),
                           100.0 * double(counts[i]) / double(grid.cells.size()));
    }
    return out + "</tbody></table>\n";
}

std::string grid_facts(const VoxelGrid& grid, std::string_view xxh64)
{
    const Bounds b = bounds_of(grid);
    const auto without = uint64_t(std::ranges::count(grid.generated, 0));
    std::string out = "<dl>\n";
    append_fact(out, "cells", counted(grid.cells.size()));
    append_fact(out, "voxel size", fmt::format("{:g} m", grid.voxel_size));
    if (grid.has_points()) {
        const uint64_t points = (grid.cells.size() - without) * uint64_t(grid.points_per_voxel);
        append_fact(out, "points", fmt::format("{}, {} in a voxel", counted(points), grid.points_per_voxel));
        if (without)
            append_fact(out, "voxels without points", counted(without));
    } else {
        append_fact(out, "points", "none, only labels");
    }
    append_fact(out, "extent",
                fmt::format("{:.1f} &times; {:.1f} &times; {:.1f} m", b.high[0] - b.low[0], b.high[1] - b.low[1],
                            b.high[2] - b.low[2]));
    for (const auto& [key, value] : grid.metadata)
        append_fact(out, key, fmt::format("<bdi>{}</bdi>", html_text(value)));
    append_fact(out, "xxh64", fmt::format("<span class=\"hash\">{}</span>", html_text(xxh64)));
    return out + "</dl>\n";
}

Result<PageRun> read_page_run(const Path& file_or_folder)
{
    const Path file = is_folder(file_or_folder) ? file_or_folder / "run.json" : file_or_folder;
    SR_TRY(const Json json, read_json(file, kLimits));
    const auto settings = json.is_object() ? json.find("settings") : json.end();
    if (settings == json.end() || !settings->is_object())
        return fail(ErrorCode::bad_input, "{}: expected a run with \"settings\", found {}", quote_path(file),
                    json.is_object() ? "an object without them" : json.type_name());
    PageRun run{"run", "", Json::object(), Json::object()};
    flatten(*settings, "", run.settings);
    if (const auto results = json.find("results"); results != json.end())
        flatten(*results, results->is_structured() ? "" : "results", run.results);
    for (const auto& [key, to] : {std::pair{"state", &run.state}, {"command", &run.command}}) {
        const Json& from = *key == 's' ? json : run.settings;
        if (const auto value = from.find(key); value != from.end())
            *to = text_of(*value);
    }
    run.settings.erase("command");
    return run;
}

std::string run_table(const std::vector<PageRun>& runs)
{
    std::vector<Row> settings, results;
    add_rows(settings, runs, false, kSettings);
    add_rows(results, runs, true, kResults);
    std::string out = "<div class=\"scroll\"><table>" + head(runs);
    for (const auto& [name, rows] : {std::pair{"Settings", &settings}, {"Results", &results}}) {
        if (rows->empty())
            continue;
        out += fmt::format("<tbody><tr><th colspan=\"{}\">{}</th></tr>\n", runs.size() + 1, name);
        for (const Row& row : *rows)
            append_row(out, row, runs);
        out += "</tbody>\n";
    }
    out += "</table></div>\n";
    settings.insert(settings.end(), results.begin(), results.end());
    const std::vector<Row> rest = other_rows(runs, settings);
    if (rest.empty())
        return out;
    out += "<details><summary>All that the runs recorded</summary><div class=\"scroll\"><table>" + head(runs) +
           "<tbody>\n";
    for (const Row& row : rest)
        append_row(out, row, runs);
    return out + "</tbody></table></div></details>\n";
}

Result<PageFigures> read_page_figures(const Path& file)
{
    SR_TRY(const Json json, read_json(file, kLimits));
    if (!json.is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object of names and values, found {}", quote_path(file),
                    json.type_name());
    PageFigures figures{file.stem().string(), {}};
    for (const auto& [key, value] : json.items()) {
        if (value.is_structured())
            return fail(ErrorCode::bad_input, "{}: {}: expected a number or text, found an {}", quote_path(file),
                        quote(key), value.type_name());
        figures.values.emplace_back(key, text_of(value));
    }
    if (figures.values.empty())
        return fail(ErrorCode::bad_input, "{}: there are no figures in it", quote_path(file));
    return figures;
}

std::string figure_table(const PageFigures& figures)
{
    std::string out = fmt::format("<h3><bdi>{}</bdi></h3>\n<table><tbody>\n", html_text(figures.name, 200));
    for (const auto& [name, value] : figures.values)
        out += fmt::format("<tr><th scope=\"row\"><bdi>{}</bdi></th><td class=\"number\"><bdi>{}</bdi></td></tr>\n",
                           html_text(name, 200), html_text(value));
    return out + "</tbody></table>\n";
}

} // namespace semrover
