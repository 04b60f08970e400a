// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/camera/ftheta_json.h"

#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

namespace semrover {

namespace {

Status read_polynomial(const Json& json, const char* key, Distortion& to, std::string_view where)
{
    const std::string what = fmt::format("{}: {}", where, key);
    if (!json.contains(key))
        return fail(ErrorCode::bad_input, "{} is missing", what);
    SR_TRY(const std::vector<double> values, numbers_of(json[key], what));
    if (values.size() < 2 || values.size() > 6 || values[0] != 0)
        return fail(ErrorCode::bad_input, "{}: expected 2 to 6 numbers, the first 0, found {}{}", what, values.size(),
                    values.empty() ? "" : fmt::format(", the first {}", values[0]));
    std::copy(values.begin() + 1, values.end(), to.begin());
    return {};
}

} // namespace

Status read_ftheta(const Json& json, Intrinsics& k, std::string_view where)
{
    k.model = CameraModel::ftheta;
    k.fx = k.fy = 1;
    SR_TRY(const auto principal_point, numbers_at<2>(json, "principal_point", where));
    k.cx = principal_point[0] + 0.5; // of pixels' corners
    k.cy = principal_point[1] + 0.5;
    const Json reference = json.value("reference_poly", Json());
    const bool backward = reference == "PIXELDIST_TO_ANGLE";
    if (!backward && reference != "ANGLE_TO_PIXELDIST")
        return fail(ErrorCode::bad_input,
                    "{}: reference_poly: expected \"PIXELDIST_TO_ANGLE\" or \"ANGLE_TO_PIXELDIST\", found {}", where,
                    printable(json_text(reference, -1, true), 60));
    k.distortion = {};
    SR_CHECK(
        read_polynomial(json, backward ? "pixeldist_to_angle_poly" : "angle_to_pixeldist_poly", k.distortion, where));
    std::array<double, 3> cde = {1, 0, 0};
    if (json.contains("linear_cde")) {
        SR_TRY(cde, numbers_at<3>(json, "linear_cde", where));
    }
    std::ranges::copy(cde, k.distortion.begin() + 5);
    SR_TRY(const std::optional<double> max_angle, optional_number(json, "max_angle", where));
    if (!max_angle)
        return fail(ErrorCode::bad_input, "{}: max_angle is missing", where);
    k.distortion[8] = *max_angle;
    k.distortion[9] = backward ? 1 : 0;
    return {};
}

} // namespace semrover
