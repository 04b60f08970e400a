// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/label_map.h"
#include "engine/mesh/mesh_files.h"
#include "runtime/base/quote.h"

#include <bit>

namespace semrover {

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie in memory");

Status write_mesh_ply(const Path& path, const Mesh& mesh)
{
    SR_CHECK(check_mesh(mesh, "cannot write " + quote_path(path)));
    const bool colors = !mesh.colors.empty(), labels = !mesh.face_labels.empty();
    std::string bytes =
        fmt::format("ply\nformat binary_little_endian 1.0\n{}element vertex {}\nproperty float x\nproperty float y\n"
                    "property float z\n{}element face {}\nproperty list uchar int vertex_indices\n{}end_header\n",
                    labels ? fmt::format("comment {}\n", kOwnLabelsComment) : "", mesh.positions.size(),
                    colors ? "property uchar red\nproperty uchar green\nproperty uchar blue\n" : "", mesh.faces.size(),
                    labels ? "property uchar label\n" : "");
    bytes.reserve(bytes.size() + mesh.positions.size() * 15 + mesh.faces.size() * 14);
    for (size_t i = 0; i < mesh.positions.size(); ++i) {
        bytes.append(reinterpret_cast<const char*>(mesh.positions[i].data()), 12);
        if (colors)
            bytes.append(reinterpret_cast<const char*>(mesh.colors[i].data()), 3);
    }
    for (size_t i = 0; i < mesh.faces.size(); ++i) {
        bytes.push_back(3);
        bytes.append(reinterpret_cast<const char*>(mesh.faces[i].data()), 12);
        if (labels)
            bytes.push_back(char(mesh.face_labels[i]));
    }
    return write_file_atomically(path, bytes);
}

} // namespace semrover
