// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/lens_options.h"

#include "runtime/base/quote.h"
#include "tools/cli/choice.h"
#include "tools/cli/number_option.h"

#include <array>
#include <charconv>
#include <CLI/CLI.hpp>
#include <cmath>

namespace semrover {

namespace {

// numbers with commas between them
Result<std::vector<double>> numbers_in(std::string_view text)
{
    std::vector<double> numbers;
    for (const char *at = text.data(), *end = at + text.size(); at < end;) {
        double value = 0;
        const auto [next, error] = std::from_chars(at, end, value);
        if (error != std::errc() || !std::isfinite(value) || (next < end && (*next != ',' || next + 1 == end)))
            return fail(ErrorCode::usage, "--distortion takes numbers with commas between them, not {}", quote(text));
        numbers.push_back(value);
        at = next + (next < end);
    }
    return numbers;
}

Status put_distortion(const LensOptions& o, Intrinsics& k)
{
    if (o.distortion.empty())
        return {};
    SR_TRY(const std::vector<double> values, numbers_in(o.distortion));
    const size_t n = values.size();
    if (!(k.model == CameraModel::opencv && (n == 4 || n == 5 || n == 8)) &&
        !(k.model == CameraModel::fisheye && n == 4))
        return fail(
            ErrorCode::usage,
            "--distortion takes k1,k2,p1,p2[,k3[,k4,k5,k6]] of --camera-model opencv or k1,k2,k3,k4 of fisheye, "
            "not {} numbers of {}",
            n, name_of(k.model));
    std::ranges::copy(values, k.distortion.begin());
    return {};
}

} // namespace

void add_lens_options(CLI::App& c, LensOptions& o)
{
    const auto set = [&o](uint32_t& to) {
        return [&o, &to](uint32_t pixels) {
            to = pixels;
            o.size_given = true;
        };
    };
    add_number_function<uint32_t>(c, "-W,--width", set(o.width), "pixels", {1, 16384});
    add_number_function<uint32_t>(c, "-H,--height", set(o.height), "pixels", {1, 16384});
    add_number_function<double>(c, "--fov-x",
                                [&o](double degrees) {
                                    o.fov = degrees;
                                    o.view_given = true;
                                },
                                "horizontal field of view in degrees, where the path has no intrinsics; 73",
                                {1.0, 360.0});
    add_choice(c, "--camera-model", {"pinhole", "opencv", "fisheye", "equirectangular"},
               "lens, where the path has no intrinsics", o.camera_model);
    c.add_option("--distortion", o.distortion, "k1,k2,p1,p2[,k3[,k4,k5,k6]] of opencv, k1,k2,k3,k4 of fisheye");
}

std::span<const std::string_view> lens_options()
{
    static constexpr std::array<std::string_view, 5> kNames = {"--width", "--height", "--fov-x", "--camera-model",
                                                               "--distortion"};
    return kNames;
}

Result<Intrinsics> intrinsics_of(const LensOptions& o)
{
    const CameraModel model = camera_model_of(o.camera_model).value_or(CameraModel::pinhole);
    const bool plane = model == CameraModel::pinhole || model == CameraModel::opencv;
    if (plane && o.fov > 170)
        return fail(ErrorCode::usage, "--fov-x of {} degrees: a {} camera sees at most 170", o.fov, name_of(model));
    Intrinsics k = plane                           ? pinhole_from_fov(o.fov, o.width, o.height)
                   : model == CameraModel::fisheye ? fisheye_from_fov(o.fov, o.width, o.height)
                                                   : whole_sphere(o.width, o.height);
    k.model = model;
    SR_CHECK(put_distortion(o, k));
    if (const Status status = check_intrinsics(k, "--distortion"); !status)
        return fail(ErrorCode::usage, "{}", status.error().message);
    return simplified(k);
}

Result<PathLens> path_lens_of(const LensOptions& o)
{
    SR_TRY(const Intrinsics intrinsics, intrinsics_of(o));
    return PathLens(intrinsics, o.size_given, o.view_given || o.camera_model == "equirectangular");
}

} // namespace semrover
