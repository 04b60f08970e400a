// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover page -o index.html --grid GRID: one HTML file that shows a finished run
#include "tools/page/page.h"
#include "engine/job/outputs.h"
#include "engine/job/version.h"
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"
#include "tools/cli/camera_options.h"
#include "tools/cli/commands.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/progress.h"
#include "tools/cli/value_options.h"
#include "tools/trajectory/camera_path.h"

#include <algorithm>
#include <CLI/CLI.hpp>

namespace semrover {

namespace {

constexpr size_t kMaxSets = 8; // more do not fit side by side

struct PageArguments {
    std::string output, grid, truth, title, about, path;
    PathOptions placement;
    std::vector<std::string> frames, runs, figures;
    PictureOptions pictures;
    uint64_t max_points = 400000;
};

// a word as a shell takes it
std::string shell_word(std::string_view word)
{
    constexpr std::string_view kPlain = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-./=:,@%+";
    if (!word.empty() && word.find_first_not_of(kPlain) == std::string_view::npos)
        return std::string(word);
    std::string out = "'";
    for (const char c : word)
        out += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return out + "'";
}

// the command line that makes this page, options in one order
std::string command_line(const PageArguments& o)
{
    std::string out = "semrover page";
    const auto add = [&](std::string_view option, std::string_view value) {
        if (!value.empty())
            out += fmt::format(" {} {}", option, shell_word(value));
    };
    add("-o", o.output);
    add("--grid", o.grid);
    add("--truth", o.truth);
    add("--title", o.title);
    add("--about", o.about);
    for (const auto& [option, values] :
         {std::pair{"--frames", &o.frames}, {"--run", &o.runs}, {"--figures", &o.figures}})
        for (const std::string& value : *values)
            add(option, value);
    add("--path", o.path);
    add("--relative-to", o.placement.relative_to);
    add("--calib", o.placement.calibration);
    add("--world", o.placement.world);
    add("--origin", o.placement.origin);
    const PageArguments defaults;
    if (o.pictures.limit != defaults.pictures.limit)
        add("--max-frames", std::to_string(o.pictures.limit));
    if (o.pictures.quality != defaults.pictures.quality)
        add("--quality", std::to_string(o.pictures.quality));
    if (o.max_points != defaults.max_points)
        add("--max-points", std::to_string(o.max_points));
    return out;
}

Result<std::vector<PictureSet>> picture_sets(const PageArguments& o)
{
    std::vector<PictureSet> sets;
    for (const std::string& text : o.frames) {
        const size_t equals = text.find('=');
        if (equals == std::string::npos || equals == 0 || equals + 1 == text.size())
            return fail(ErrorCode::usage, "--frames: expected NAME=FOLDER, found {}", quote(text));
        PictureSet set{text.substr(0, equals), text.substr(equals + 1)};
        if (std::ranges::any_of(sets, [&](const PictureSet& other) { return other.name == set.name; }))
            return fail(ErrorCode::usage, "--frames: two sets have the name {}", quote(set.name));
        sets.push_back(std::move(set));
    }
    if (sets.size() > kMaxSets)
        return fail(ErrorCode::usage, "--frames: {} sets of pictures, at most {} have room", sets.size(), kMaxSets);
    return sets;
}

Result<PageScene> load_scene(const std::string& name, const Path& path, uint64_t max_points)
{
    SR_TRY(VoxelGrid grid, read_grid(path));
    SR_TRY(const uint64_t hash, hash_file(path));
    PagePoints points = page_points(grid, max_points);
    return PageScene{name, std::move(grid), hash_text(hash), std::move(points)};
}

Result<PictureTable> load_pictures(const PageArguments& o, const Globals& globals)
{
    SR_TRY(const std::vector<PictureSet> sets, picture_sets(o));
    std::optional<Progress> progress;
    const auto done = [&](uint64_t count, uint64_t total) -> Status {
        if (!progress)
            progress.emplace(progress_to_stderr(globals), "page", "pictures", total);
        progress->update(count);
        if (interrupt_requested())
            return fail(ErrorCode::interrupted, "interrupted after {} pictures; nothing was kept", count);
        return {};
    };
    SR_TRY(PictureTable table, read_pictures(sets, o.pictures, done));
    if (progress)
        progress->finish();
    for (const std::string& warning : table.warnings)
        if (!globals.quiet)
            print_stderr("semrover: warning: {}\n", warning);
    return table;
}

Result<PageContent> load_content(const PageArguments& o, const Globals& globals)
{
    PageContent c;
    c.program = kProgram;
    c.command = command_line(o);
    SR_TRY(c.scenes.emplace_back(), load_scene(o.truth.empty() ? "scene" : "Generated", o.grid, o.max_points));
    if (!o.truth.empty()) {
        SR_TRY(c.scenes.emplace_back(), load_scene("Truth", o.truth, o.max_points));
    }
    const auto& metadata = c.scenes[0].grid.metadata;
    c.title = !o.title.empty() ? o.title : metadata.contains("name") ? metadata.at("name") : "A scene";
    c.about = o.about;
    for (const std::string& run : o.runs) {
        SR_TRY(c.runs.emplace_back(), read_page_run(run));
    }
    for (const std::string& figures : o.figures) {
        SR_TRY(c.figures.emplace_back(), read_page_figures(figures));
    }
    if (!o.path.empty()) { // where the camera is and looks; its lens does not matter
        SR_TRY(PathLens lens, path_lens_of({}));
        lens.matters = false;
        SR_TRY(const PathPlacement placement, placement_of(o.placement));
        SR_TRY(c.path, read_camera_path(o.path, lens, placement));
    }
    SR_TRY(c.pictures, load_pictures(o, globals));
    return c;
}

Status page(const PageArguments& o, const Globals& globals)
{
    if (o.path.empty() && o.placement.any())
        return fail(ErrorCode::usage, "--relative-to, --calib, --world and --origin are of a trajectory: --path");
    SR_CHECK(check_writable(o.output, globals.yes));
    SR_TRY(const PageContent content, load_content(o, globals));
    const std::string html = page_html(content);
    SR_CHECK(write_file_atomically(o.output, html));
    const uint64_t points = content.scenes[0].points.count;
    if (globals.json)
        fmt::print("{}\n", json_text(Json{{"output", o.output},
                                          {"bytes", html.size()},
                                          {"sets", content.pictures.names.size()},
                                          {"moments", content.pictures.moments.size()},
                                          {"points", points},
                                          {"cells", content.scenes[0].grid.cells.size()}}));
    else if (!globals.quiet)
        fmt::print("{}: {}, {} moments of {} sets of pictures, {} points\n", quote_path(o.output),
                   bytes_text(html.size()), content.pictures.moments.size(), content.pictures.names.size(), points);
    return {};
}

} // namespace

void add_page(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<PageArguments>();
    CLI::App* c = app.add_subcommand("page", "one HTML file that shows a finished run: pictures, points, figures");
    c->add_option("-o,--output", o->output, "the file, such as index.html")->required();
    c->add_option("--grid", o->grid, "a .sgrid file: the scene")->required();
    c->add_option("--truth", o->truth, "another .sgrid file, to look at in its place");
    c->add_option("--title", o->title, "of the page; else the grid's name");
    c->add_option("--about", o->about, "a sentence or two below the title");
    CLI::Option* frames =
        c->add_option("--frames", o->frames, "NAME=FOLDER of pictures 000000.png; several lie beside each other");
    c->add_option("--run", o->runs, "a run's folder, or its run.json, for the table of settings and results");
    c->add_option("--figures", o->figures, "a JSON object of names and values, for a table of its own");
    c->add_option("--path", o->path, "a trajectory of any format, to follow in the scene");
    add_placement_options(*c, o->placement);
    add_number(*c, "--max-frames", o->pictures.limit, "moments at most, evenly chosen", 1u, 2000u)->needs(frames);
    add_number(*c, "--quality", o->pictures.quality, "of JPEG", 1, 100)->needs(frames);
    add_number(*c, "--max-points", o->max_points, "points of a scene at most, evenly chosen", uint64_t(1),
               uint64_t(20000000));
    c->callback([o, &globals, &run] { run = [o, &globals] { return page(*o, globals); }; });
}

} // namespace semrover
