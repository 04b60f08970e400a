// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/scene/grid.h"
#include "runtime/base/file.h"
#include "runtime/base/json.h"
#include "runtime/base/result.h"

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace semrover {

// text from anywhere, fit for an element or a quoted attribute of a page: markup is escaped, control characters and
// what is not UTF-8 become \xNN, and what exceeds `limit` bytes is replaced by "..."
std::string html_text(std::string_view text, size_t limit = 2000);

// a value as a page's script may hold it: ASCII, and nothing in it ends the script
std::string script_json(const Json& value);

std::string base64(std::span<const std::byte> bytes);

// 1234567 as "1,234,567"
std::string counted(uint64_t number);

// the points of a grid as a page draws them. Where no voxel has points, the cells' centres stand for them, in the
// colours of their labels.
struct PagePoints {
    uint64_t count = 0, total = 0;     // points kept, points of the grid
    std::array<double, 3> low{}, step; // metres: a coordinate q is low + q * step, q of 0..65535
    double diameter = 0;               // metres, of a point, so that neighbours touch
    bool centers = false;              // not points but voxels
    std::vector<std::byte> bytes;      // [count, 3] u16 little endian, [count, 3] u8 sRGB, [count] u8 label
};

// at most `limit` points (at least 1), every n-th in the order of the grid; the same grid gives the same bytes
PagePoints page_points(const VoxelGrid& grid, uint64_t limit);

// tables of a page, as HTML

std::string class_table(const VoxelGrid& grid);                        // voxels of each class, most first
std::string grid_facts(const VoxelGrid& grid, std::string_view xxh64); // sizes, extent, and what its metadata says

// run.json of a run folder (run_folder.h)
struct PageRun {
    std::string command, state; // as the file says
    Json settings, results;     // objects; results may be empty
};
// at most 1 MiB; bad_input for what is no run
Result<PageRun> read_page_run(const Path& file_or_folder);
// a column a run; what few ask for is folded away
std::string run_table(const std::vector<PageRun>& runs);

// figures of any kind: an object of name to number, text, true, false or null
struct PageFigures {
    std::string name; // the file's, without .json
    std::vector<std::pair<std::string, std::string>> values;
};
Result<PageFigures> read_page_figures(const Path& file); // at most 1 MiB; bad_input names the entry
std::string figure_table(const PageFigures& figures);

// a folder of pictures NNNNNN.png (or .jpg), one a moment, as `render`, `refine` and `streets` write them
struct PictureSet {
    std::string name;
    Path folder;
};

struct PictureOptions {
    uint32_t limit = 48; // moments, evenly chosen, first and last among them
    int quality = 85;    // of JPEG
};

struct Picture {
    std::string type; // of media: image/png, image/jpeg
    std::vector<std::byte> file;
};

// several sets of pictures of the same moments
struct PictureTable {
    std::vector<std::string> names;                   // [S]
    std::vector<std::pair<uint32_t, uint32_t>> sizes; // [S] width, height
    std::vector<uint32_t> moments;                    // [M] numbers of the files
    std::vector<std::vector<Picture>> pictures;       // [S][M]
    uint64_t shared = 0;                              // moments that all sets have
    std::vector<std::string> warnings;                // a line each
};

// Pictures are encoded anew: as JPEG, or as PNG where that is hardly larger or the picture is drawn in few
// colours (labels), so that nothing of the files but
// their pixels gets in. Moments that a set lacks are left out, with a warning. bad_input: no pictures, two of one
// number, no moment that all sets have, another size within a set, another shape than the first set's.
// `done` hears how many pictures there are after each one and may stop.
Result<PictureTable> read_pictures(const std::vector<PictureSet>& sets, const PictureOptions& options,
                                   const std::function<Status(uint64_t done, uint64_t total)>& done);

struct PageScene {
    std::string name;
    VoxelGrid grid;
    std::string xxh64; // of the file
    PagePoints points; // of the grid
};

// what a page shows; text may come from anywhere
struct PageContent {
    std::string title, about;      // about: a sentence or two; empty: one is made
    std::string program, command;  // what made the page
    PictureTable pictures;         // none: no player
    std::vector<PageScene> scenes; // at least one; the tables are about the first
    CameraPath path;               // of the first camera, through the scenes; may be empty
    std::vector<PageRun> runs;
    std::vector<PageFigures> figures;
};

// One HTML file that needs nothing outside it: no network, no other file. The same content gives the same bytes.
std::string page_html(const PageContent& content);

} // namespace semrover
