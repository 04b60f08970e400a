// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "tools/page/page_pictures.h"
#include "tools/page/page_points.h"
#include "tools/page/page_tables.h"

namespace semrover {

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
