// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/export/exporters.h"

namespace semrover {

// makes the folder, too
Status put_file(const Path& path, std::span<const std::byte> bytes);
Status put_file(const Path& path, std::string_view text);

// The colours of a picture as a JPEG or PNG: the file's own bytes where it is one
Result<std::vector<std::byte>> color_file(const DriveInput& drive, size_t picture, bool jpeg, int quality);

// points of a scan as little-endian rows of the first `columns` numbers of what `row` makes of each
template <typename Row>
std::vector<std::byte> scan_rows(std::span<const ScanPoint> points, const Row& row)
{
    std::vector<std::byte> bytes;
    for (const ScanPoint& point : points) {
        const auto numbers = row(point);
        const auto added = std::as_bytes(std::span(numbers));
        bytes.insert(bytes.end(), added.begin(), added.end());
    }
    return bytes;
}

std::string rows_text(Rigid matrix, size_t rows); // of 4 numbers, with blanks between all
std::string matrix_text(const Rigid& matrix);     // a line a row

// bad_input unless it is a pinhole: what layout `where` holds
Status check_pinhole(const Sensor& sensor, std::string_view where);

// camera axes x forward, y left, z up to the vehicle's
Rigid forward_to_vehicle(const Sensor& sensor);

} // namespace semrover
