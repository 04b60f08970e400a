// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/export/drive_input.h"

namespace semrover {

struct ExportOptions {
    std::string camera = {}; // of layouts that have one; empty: the first
    int quality = 95;        // of JPEGs that are made of PNGs, 1 to 100
    uint32_t val = 0;        // how many of the drives, the last ones, are for validation
};

// what was written, and what had no place
struct ExportReport {
    size_t pictures = 0, boxes = 0, scans = 0;
    std::map<std::string, size_t> left_out = {}; // boxes, by class
    std::vector<std::string> warnings = {};
};

// Writes drives into `out`, a folder that is there and empty. Equal drives and options give equal bytes. Errors:
// bad_input for what the layout has no place for, such as a lens
using Exporter = Result<ExportReport> (*)(std::span<const DriveInput> drives, const Path& out,
                                          const ExportOptions& options);

Result<ExportReport> export_kitti(std::span<const DriveInput>, const Path& out, const ExportOptions&);
Result<ExportReport> export_nuscenes(std::span<const DriveInput>, const Path& out, const ExportOptions&);
Result<ExportReport> export_infinicube(std::span<const DriveInput>, const Path& out, const ExportOptions&);
Result<ExportReport> export_drivestudio(std::span<const DriveInput>, const Path& out, const ExportOptions&);
Result<ExportReport> export_transforms(std::span<const DriveInput>, const Path& out, const ExportOptions&);
Result<ExportReport> export_colmap(std::span<const DriveInput>, const Path& out, const ExportOptions&);

struct NamedExporter {
    const char* name;
    Exporter run;
    bool several; // drives
};
constexpr NamedExporter kExporters[] = {
    {"nuscenes", export_nuscenes, true},      {"kitti", export_kitti, true},
    {"infinicube", export_infinicube, true},  {"drivestudio", export_drivestudio, true},
    {"transforms", export_transforms, false}, {"colmap", export_colmap, false},
};

} // namespace semrover
