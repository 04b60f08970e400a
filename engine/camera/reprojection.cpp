// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/camera/reprojection.h"

namespace semrover {

Reprojection::Reprojection(const CameraFrame& from, const CameraFrame& to)
    : from_(from.intrinsics), to_(to.intrinsics), move_(compose(from.pose.world_to_camera, to.pose.camera_to_world()))
{
}

std::optional<Projection> Reprojection::source(double x, double y, double depth) const
{
    const std::optional<Point3> ray = to_.ray(x, y);
    if (!ray || !(to_.depth(*ray) > 0))
        return {};
    const double far = depth / to_.depth(*ray);
    return from_.project(transform(move_, {(*ray)[0] * far, (*ray)[1] * far, (*ray)[2] * far}));
}

} // namespace semrover
