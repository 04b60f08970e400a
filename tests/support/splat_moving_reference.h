// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tests/support/splat_lens_reference.h"

// the splat rasteriser of cameras that move while they are read out, in double, after docs/method.md §5.4: a line of
// the picture is that line of a still camera's picture from where the camera is then; a splat's dot is where the line
// that shows its centre has it
namespace semrover {

struct MovingCamera {
    Intrinsics intrinsics;
    Rigid from = kIdentity, to = kIdentity; // camera to world
    ShutterDirection direction = ShutterDirection::down;

    bool by_rows() const { return direction == ShutterDirection::down || direction == ShutterDirection::up; }
    uint32_t lines() const { return by_rows() ? intrinsics.height : intrinsics.width; }
    // share of the readout at which a place along the lines is read
    double share(double line) const
    {
        const bool forward = direction == ShutterDirection::down || direction == ShutterDirection::right;
        return forward ? line / lines() : 1 - line / lines();
    }
    LensCamera at(double share) const
    {
        const Rigid view = inverse(interpolate(from, to, share));
        LensCamera camera{intrinsics, {}};
        if (intrinsics.model == CameraModel::pinhole) // one whose nearness is along z
            camera.intrinsics.model = CameraModel::opencv;
        std::copy_n(view.begin(), 12, camera.view.begin());
        return camera;
    }
    CameraFrame frame() const
    {
        CameraFrame f;
        f.pose = {inverse(from)};
        f.intrinsics = intrinsics;
        f.readout = Readout{direction, f.pose, {inverse(to)}};
        return f;
    }
};

// how a thing goes during the readout: from what its splats are given in to the world
struct HostMover {
    Rigid from = kIdentity, to = kIdentity;

    HostSplat at(HostSplat s, double share) const
    {
        const Rigid pose = interpolate(from, to, share);
        const Point3 tip =
            transform(pose, {s.position[0] + s.normal[0], s.position[1] + s.normal[1], s.position[2] + s.normal[2]});
        s.position = transform(pose, s.position);
        for (size_t a = 0; a < 3; ++a)
            s.normal[a] = tip[a] - s.position[a];
        return s;
    }
};

// shares at which the line is read that shows the centre then; lines beyond the picture are read with the nearest
inline std::vector<double> own_shares(const HostSplat& s, const MovingCamera& c, const Lens& lens,
                                      const SplatRules& rules, const HostMover& mover = {}, int steps = 400)
{
    const auto off = [&](double share) -> std::optional<double> {
        const LensSplat placed = place(mover.at(s, share), c.at(share), lens, rules);
        if (!placed.pixel)
            return {};
        return std::clamp(c.share(c.by_rows() ? placed.pixel->y : placed.pixel->x), 0.0, 1.0) - share;
    };
    std::vector<double> shares;
    std::optional<double> before = off(0);
    if (before && *before == 0)
        shares.push_back(0);
    for (int i = 0; i < steps; ++i) {
        double low = double(i) / steps, high = double(i + 1) / steps;
        const std::optional<double> after = off(high);
        if (after && *after == 0) {
            shares.push_back(high);
        } else if (before && after && *before * *after < 0) {
            const double sign = *before;
            for (int halving = 0; halving < 50; ++halving) {
                const double middle = (low + high) / 2;
                const auto there = off(middle);
                (there && *there * sign > 0 ? low : high) = middle;
            }
            const auto found = off((low + high) / 2);
            if (found && std::abs(*found) < 1e-9) // not where a panorama's seam jumps
                shares.push_back((low + high) / 2);
        }
        before = after;
    }
    return shares;
}

// what all lines take of a splat: its order, its dot
inline LensSplat own_view(const HostSplat& s, const MovingCamera& c, const Lens& lens, const SplatRules& rules,
                          const HostMover& mover)
{
    const std::vector<double> shares = own_shares(s, c, lens, rules, mover);
    const double share = shares.empty() ? 0.5 : shares[0];
    LensSplat own = place(mover.at(s, share), c.at(share), lens, rules);
    if (shares.empty())
        own.pixel = {};
    own.key = std::max(own.key, 0.0);
    return own;
}

inline LensSplat in_line(const HostSplat& s, const LensCamera& camera, const LensSplat& own, const Lens& lens,
                         const SplatRules& rules)
{
    LensSplat placed = place(s, camera, lens, rules);
    placed.key = own.key;
    placed.depth = own.depth;
    placed.pixel = own.pixel;
    return placed;
}

inline std::vector<ReferencePixel> render_reference(const std::vector<HostSplat>& splats, const MovingCamera& camera,
                                                    const SplatRules& rules = {},
                                                    const std::vector<HostMover>& movers = {}) // of each splat, or none
{
    const Lens lens(camera.intrinsics);
    std::vector<LensSplat> own;
    std::vector<size_t> order(splats.size());
    const auto mover_of = [&](size_t i) { return movers.empty() ? HostMover() : movers[i]; };
    for (size_t i = 0; i < splats.size(); ++i)
        own.push_back(own_view(splats[i], camera, lens, rules, mover_of(i)));
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return own[a].key < own[b].key; });
    const uint32_t width = camera.intrinsics.width, height = camera.intrinsics.height;
    std::vector<ReferencePixel> image(size_t(width) * height);
    for (uint32_t line = 0; line < camera.lines(); ++line) {
        const double share = camera.share(line + 0.5);
        const LensCamera still = camera.at(share);
        std::vector<LensSplat> placed;
        for (size_t j = 0; j < splats.size(); ++j)
            placed.push_back(in_line(mover_of(j).at(splats[j], share), still, own[j], lens, rules));
        for (uint32_t across = 0; across < (camera.by_rows() ? width : height); ++across) {
            const uint32_t column = camera.by_rows() ? across : line, row = camera.by_rows() ? line : across;
            const double x = column + 0.5, y = row + 0.5;
            const std::optional<Point3> ray = lens.ray(x, y);
            if (!ray)
                continue;
            ReferencePixel& pixel = image[size_t(row) * width + column];
            double t = 1;
            for (const size_t j : order) {
                double z;
                if (!placed[j].kept)
                    continue;
                const double alpha = alpha_at(placed[j], splats[j], still, lens, x, y, *ray, rules, z);
                if (!cover(pixel, t, splats[j], placed[j].normal, alpha, z, j, rules))
                    break;
            }
            pixel.alpha = 1 - t;
        }
    }
    return image;
}

} // namespace semrover
