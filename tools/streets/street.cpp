// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/street.h"

#include "engine/scene/palette.h"
#include "tools/streets/street_parts.h"

namespace semrover {

Street make_street(const StreetOptions& options)
{
    Street street{RoadNetwork(options.seed, options.length), {}, {}, {}, {}};
    MeshBuilder mesh;
    Site site{mesh, street.road, options.seed, street.objects};
    add_road_surface(mesh, street.road, options.seed);
    add_plots(site);
    add_furnishing(site);
    add_traffic(site);
    street.gloss = mesh.gloss();
    street.boxes = std::move(mesh.objects());
    add_ground_objects(street.road, street.boxes);
    street.mesh = std::move(mesh).take();
    return street;
}

std::vector<ClassShare> class_shares(const Mesh& mesh)
{
    std::vector<ClassShare> shares(kClassCount);
    for (size_t f = 0; f < mesh.faces.size(); ++f) {
        const auto at = [&](size_t corner) {
            const auto& p = mesh.positions[mesh.faces[f][corner]];
            return Vector3{p[0], p[1], p[2]};
        };
        ClassShare& share = shares[mesh.face_labels[f]];
        ++share.faces;
        share.area += length(cross(at(1) - at(0), at(2) - at(0))) / 2;
    }
    return shares;
}

} // namespace semrover
