// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/ply.h"

#include "engine/camera/rigid.h"
#include "engine/format/label_map.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace semrover {

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie in memory");

namespace {

using Float3 = std::array<float, 3>;

constexpr float kMinOpacity = 1e-6f; // keeps the logit finite: -13.8 to 13.8
constexpr size_t kRestCoefficients = 45;

Float3 cross(const Float3& a, const Float3& b)
{
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

Float3 normalized(const Float3& a)
{
    const float length = std::sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    return {a[0] / length, a[1] / length, a[2] / length};
}

bool is_finite(const Float3& a)
{
    return std::isfinite(a[0]) && std::isfinite(a[1]) && std::isfinite(a[2]);
}

void append(std::vector<std::byte>& bytes, const void* data, size_t size)
{
    const auto* first = static_cast<const std::byte*>(data);
    bytes.insert(bytes.end(), first, first + size);
}

void append(std::vector<std::byte>& bytes, std::initializer_list<float> values)
{
    append(bytes, values.begin(), values.size() * sizeof(float));
}

std::vector<std::byte> header(std::string_view comments, size_t count, std::string_view properties)
{
    const std::string text = fmt::format("ply\nformat binary_little_endian 1.0\n{}element vertex {}\n{}end_header\n",
                                         comments, count, properties);
    std::vector<std::byte> bytes;
    append(bytes, text.data(), text.size());
    return bytes;
}

Status check_points(const Path& path, const Splats& s)
{
    const size_t n = s.position.size();
    SR_ASSERT(s.color.size() == n && s.label.size() == n, "{} points with {} colors and {} labels", n, s.color.size(),
              s.label.size());
    if (n == 0)
        return fail(ErrorCode::bad_input, "cannot write {}: there are no points", quote_path(path));
    for (size_t i = 0; i < n; ++i)
        if (!is_finite(s.position[i]) || !is_finite(s.color[i]))
            return fail(ErrorCode::bad_input, "cannot write {}: point {} has a number that is not finite",
                        quote_path(path), i);
    return {};
}

} // namespace

Status check_splats(const Path& path, const Splats& s)
{
    SR_CHECK(check_points(path, s));
    const size_t n = s.position.size();
    SR_ASSERT(s.normal.size() == n && s.sigma_u.size() == n && s.sigma_v.size() == n && s.opacity.size() == n,
              "{} splats with {} normals, {} and {} sigmas, {} opacities", n, s.normal.size(), s.sigma_u.size(),
              s.sigma_v.size(), s.opacity.size());
    for (size_t i = 0; i < n; ++i) {
        const auto& [x, y, z] = s.normal[i];
        const float norm2 = x * x + y * y + z * z;
        if (!(norm2 > 0.81f && norm2 < 1.21f))
            return fail(ErrorCode::bad_input,
                        "cannot write {}: splat {} has the normal ({}, {}, {}), expected length 1", quote_path(path), i,
                        x, y, z);
        if (!(s.sigma_u[i] > 0 && s.sigma_v[i] > 0) || !std::isfinite(s.sigma_u[i] + s.sigma_v[i]) ||
            !std::isfinite(s.opacity[i]))
            return fail(ErrorCode::bad_input, "cannot write {}: splat {} has sigmas {} and {}, opacity {}",
                        quote_path(path), i, s.sigma_u[i], s.sigma_v[i], s.opacity[i]);
    }
    return {};
}

Tangents tangents_of(const Float3& normal)
{
    const Float3 n = normalized(normal);
    const float lean[3] = {std::abs(n[0]), std::abs(n[1]), std::abs(n[2])};
    Float3 e = {0, 0, 0};
    e[static_cast<size_t>(std::min_element(lean, lean + 3) - lean)] = 1;
    const Float3 u = normalized(cross(e, n));
    return {u, cross(n, u)};
}

std::array<float, 4> splat_rotation(const Float3& normal)
{
    const auto [u, v] = tangents_of(normal);
    const Float3 n = normalized(normal);
    const Quaternion q = quaternion_of({u[0], v[0], n[0], 0, u[1], v[1], n[1], 0, u[2], v[2], n[2], 0, 0, 0, 0, 1});
    return {static_cast<float>(q[3]), static_cast<float>(q[0]), static_cast<float>(q[1]), static_cast<float>(q[2])};
}

Status write_points_ply(const Path& path, const Splats& s)
{
    SR_CHECK(check_points(path, s));
    const size_t n = s.position.size();
    std::vector<std::byte> bytes =
        header(fmt::format("comment {}\n", kOwnLabelsComment), n,
               "property float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float ny\n"
               "property float nz\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
               "property uchar label\n");
    bytes.reserve(bytes.size() + n * 28);
    constexpr std::array<float, 3> kUnknown{}; // 3DGS' trainers ask for normals and do not use them
    for (size_t i = 0; i < n; ++i) {
        append(bytes, s.position[i].data(), 12);
        append(bytes, (s.normal.empty() ? kUnknown : s.normal[i]).data(), 12);
        for (const float c : s.color[i])
            bytes.push_back(static_cast<std::byte>(std::lround(std::clamp(c, 0.f, 1.f) * 255)));
        bytes.push_back(static_cast<std::byte>(s.label[i]));
    }
    return write_file_atomically(path, bytes);
}

Status write_splats_ply(const Path& path, const Splats& s, SplatPly variant, bool labels)
{
    SR_CHECK(check_splats(path, s));
    const bool flat = variant == SplatPly::gaussian_2d;
    const size_t rest = variant == SplatPly::inria_62 ? kRestCoefficients : 0;
    std::string properties;
    for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"})
        properties += fmt::format("property float {}\n", name);
    for (size_t i = 0; i < rest; ++i)
        properties += fmt::format("property float f_rest_{}\n", i);
    for (const char* name : {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
        if (!flat || std::string_view(name) != "scale_2")
            properties += fmt::format("property float {}\n", name);
    if (labels)
        properties += "property uchar label\n";
    const size_t n = s.position.size();
    std::string comments = flat ? "comment SplatRenderMode: 2dgs\n" : "";
    if (labels)
        comments += fmt::format("comment {}\n", kOwnLabelsComment);
    std::vector<std::byte> bytes = header(comments, n, properties);
    bytes.reserve(bytes.size() + n * ((17 + rest) * sizeof(float) + labels));
    for (size_t i = 0; i < n; ++i) {
        append(bytes, s.position[i].data(), 12);
        append(bytes, s.normal[i].data(), 12);
        for (const float c : s.color[i])
            append(bytes, {(c - 0.5f) / kHarmonic0});
        bytes.insert(bytes.end(), rest * sizeof(float), std::byte(0));
        const float opacity = std::clamp(s.opacity[i], kMinOpacity, 1 - kMinOpacity);
        append(bytes, {std::log(opacity / (1 - opacity)), std::log(s.sigma_u[i]), std::log(s.sigma_v[i])});
        if (!flat)
            append(bytes, {std::log(kThinScale)});
        append(bytes, splat_rotation(s.normal[i]).data(), 16);
        if (labels)
            bytes.push_back(static_cast<std::byte>(s.label[i]));
    }
    return write_file_atomically(path, bytes);
}

} // namespace semrover
