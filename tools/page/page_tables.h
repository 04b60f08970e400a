// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"
#include "runtime/base/json.h"

#include <string>
#include <vector>

namespace semrover {

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

} // namespace semrover
