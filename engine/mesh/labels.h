// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/mesh.h"
#include "runtime/base/file.h"

#include <optional>
#include <string_view>

namespace semrover {

// the class that a material's name means: a class name, in any case, with '_', '-' and ' ' alike, alone or in
// front of something that is no letter ("Traffic_Light", "building.003", "road-lane 2"); the longest one that fits
std::optional<uint8_t> class_of_material(std::string_view name);

// What other names or numbers of a file mean: a LabelTable, whose names may be patterns ("na*e": * is any text). Names
// are compared as above; exact ones come first, then the first pattern.
class MeshLabelMap {
  public:
    MeshLabelMap() = default;
    static Result<MeshLabelMap> read(const Path& name_or_file); // read_label_table

    bool empty() const { return entries_.empty(); }
    std::optional<uint8_t> find(std::string_view name) const; // kNoLabel where the map says null
    // of a number in a file: the map's, else a class as it is (unless the map is a whole table, or the file's column is
    // another program's: LabelColumn::table), else kNoLabel for 255 and -1; none for other numbers
    std::optional<uint8_t> find(int64_t number, bool foreign = false) const;

  private:
    struct Entry {
        std::string pattern; // folded
        uint8_t label;
    };
    std::vector<Entry> entries_;
    bool whole_ = false;
};

enum class LabelSource {
    automatic, // the face's own, else its material's name, else a label texture
    material,
    texture, // a label texture, or the material's texture as one
    face,
};

// what has no label; one entry for a material, or for all faces without one
struct UnlabelledFaces {
    std::string name;
    size_t faces = 0;
    double area = 0; // m^2
};

// fills face_labels from `source`; faces that get none keep kNoLabel and are listed, the largest area first
std::vector<UnlabelledFaces> label_faces(Mesh& mesh, LabelSource source, const MeshLabelMap& map);

// "'glass' (12 faces, 3.4 m^2), ..", ten at most
std::string unlabelled_text(std::span<const UnlabelledFaces> list);

} // namespace semrover
