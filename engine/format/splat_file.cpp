// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/splat_file.h"

#include "engine/camera/rigid.h"
#include "engine/format/file_colors.h"
#include "engine/format/label_map.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace semrover {

namespace {

constexpr double kAcross = 0.05;        // correlation between the tangents that counts as lost
constexpr uint32_t kMostNumber = 65535; // of a label; others count as this one
constexpr size_t kDotSplatBytes = 32;

template <size_t N>
bool all_finite(const std::array<double, N>& values)
{
    return std::ranges::all_of(values, [](double v) { return std::isfinite(v) && std::abs(v) < 1e30; });
}

double dot(const std::array<double, 3>& a, const std::array<float, 3>& b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// columns of the rotation matrix of a unit quaternion
std::array<std::array<double, 3>, 3> axes_of(const std::array<double, 4>& q)
{
    const auto [x, y, z, w] = q;
    return {{{1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)},
             {2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)},
             {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)}}};
}

size_t smallest_axis(const std::array<double, 3>& scale)
{
    size_t axis = 2;
    for (const size_t a : {size_t(1), size_t(0)})
        if (scale[a] < scale[axis])
            axis = a;
    return axis;
}

} // namespace

void EllipsoidFlattener::add(const Ellipsoid& e, bool flat)
{
    double norm = 0;
    for (const double q : e.rotation)
        norm += q * q;
    if (!all_finite(e.position) || !all_finite(e.scale) || !all_finite(e.rotation) || !all_finite(e.color) ||
        !std::isfinite(e.opacity) || !(norm > 1e-12)) {
        ++not_finite_;
        return;
    }
    const size_t axis = flat ? 2 : smallest_axis(e.scale), first = (axis + 1) % 3, second = (axis + 2) % 3;
    const bool sized = float(e.scale[first]) > 0 && float(e.scale[second]) > 0 && e.scale[axis] >= 0;
    if (!sized || std::isinf(float(e.scale[first] + e.scale[second]))) {
        ++without_size_;
        return;
    }
    std::array<double, 4> q = e.rotation;
    for (double& c : q)
        c /= std::sqrt(norm);
    const auto axes = axes_of(q);
    const auto& n = axes[axis];
    const std::array<float, 3> normal = {float(n[0]), float(n[1]), float(n[2])};
    const Tangents t = tangents_of(normal);
    double uu = 0, vv = 0, uv = 0; // the covariance between our tangents
    for (const size_t a : {first, second}) {
        const double u = e.scale[a] * dot(axes[a], t.u), v = e.scale[a] * dot(axes[a], t.v);
        uu += u * u;
        vv += v * v;
        uv += u * v;
    }
    across_ += std::abs(uv) > kAcross * std::sqrt(uu * vv);
    thick_ += !flat && e.scale[axis] > 0.5 * std::min(e.scale[first], e.scale[second]);
    Splats& s = out_.splats;
    s.position.push_back({float(e.position[0]), float(e.position[1]), float(e.position[2])});
    s.normal.push_back(normal);
    s.sigma_u.push_back(static_cast<float>(std::sqrt(uu)));
    s.sigma_v.push_back(static_cast<float>(std::sqrt(vv)));
    s.opacity.push_back(static_cast<float>(std::clamp(e.opacity, 0.0, 1.0)));
    std::array<float, 3>& color = s.color.emplace_back();
    for (size_t a = 0; a < 3; ++a)
        color[a] = static_cast<float>(std::clamp(e.color[a], 0.0, 1.0));
    s.label.push_back(e.label);
}

Result<SplatFile> EllipsoidFlattener::finish() &&
{
    const auto warn = [&](uint64_t count, std::string_view text) {
        if (count)
            out_.warnings.push_back(fmt::format("{} splats {}", count, text));
    };
    warn(not_finite_, "that are not finite, or without a rotation, are left out");
    warn(without_size_, "without a size are left out");
    warn(across_, "are longer than wide and lie across the tangents: drawn with the same extent along these");
    warn(thick_, "are thick: drawn flat");
    warn(view_dependent_, "change their colour with the direction: drawn in the mean");
    out_.dropped = not_finite_ + without_size_;
    if (out_.splats.position.empty())
        return fail(ErrorCode::bad_input, "{}: no splat is left of {}", where_, out_.dropped);
    return std::move(out_);
}

// ---- PLY

namespace {

struct SplatColumns {
    std::array<const PlyProperty*, 3> position{}, scale{}, harmonic{};
    std::optional<PlyColors> rgb; // where there are no harmonics
    std::array<const PlyProperty*, 4> rotation{};
    const PlyProperty* opacity = nullptr;
    const PlyProperty* label = nullptr; // none where its numbers are not ours
    std::vector<const PlyProperty*> rest;
};

template <size_t N>
Status find_all(const PlyElement& element, const std::array<const char*, N>& names, bool required,
                std::array<const PlyProperty*, N>& out, const std::string& where)
{
    for (size_t i = 0; i < N; ++i) {
        out[i] = element.find(names[i]);
        if (out[i] && out[i]->is_list)
            return fail(ErrorCode::bad_input, "{}: property {} is a list", where, names[i]);
        if (!out[i] && required)
            return fail(ErrorCode::bad_input, "{}: splats need a property {}", where, names[i]);
    }
    return {};
}

Result<SplatColumns> columns_of(const PlyElement& element, const std::string& where, std::vector<std::string>& warnings)
{
    SplatColumns c;
    SR_CHECK(find_all<3>(element, {"x", "y", "z"}, true, c.position, where));
    SR_CHECK(find_all<4>(element, {"rot_1", "rot_2", "rot_3", "rot_0"}, true, c.rotation, where));
    SR_CHECK(find_all<3>(element, {"scale_0", "scale_1", "scale_2"}, false, c.scale, where));
    if (!c.scale[0] || !c.scale[1])
        return fail(ErrorCode::bad_input, "{}: splats need the properties scale_0 and scale_1", where);
    if (!element.find("f_dc_2")) {
        SR_TRY(c.rgb, PlyColors::find(element, where, warnings));
    }
    SR_CHECK(find_all<3>(element, {"f_dc_0", "f_dc_1", "f_dc_2"}, !c.rgb, c.harmonic, where));
    std::array<const PlyProperty*, 1> one{};
    SR_CHECK(find_all<1>(element, {"opacity"}, true, one, where));
    c.opacity = one[0];
    SR_CHECK(find_all<1>(element, {"label"}, false, one, where));
    c.label = one[0];
    for (const PlyProperty& p : element.properties)
        if (p.name.starts_with("f_rest_") && !p.is_list)
            c.rest.push_back(&p);
    return c;
}

// labels that are no classes of ours are left out, with a warning
Status check_labels(SplatColumns& c, size_t rows, const std::string& where, std::vector<std::string>& warnings)
{
    SR_TRY(LabelMap map, LabelMap::of_column({"label", ""}, false, {}));
    map.set(kNoLabel, "none", kEmpty);
    for (size_t row = 0; row < rows; ++row) {
        const double value = c.label->values[row];
        map(value >= 0 && value <= kMostNumber && value == std::floor(value) ? uint32_t(value) : kMostNumber);
    }
    if (const Status known = map.check(where, "splats", "all labels are left out"); !known) {
        warnings.push_back(known.error().message);
        c.label = nullptr;
        return {};
    }
    for (const std::string& line : map.assumed(where, "splats"))
        warnings.push_back(line);
    return {};
}

Ellipsoid ellipsoid_of(const SplatColumns& c, size_t row)
{
    Ellipsoid e;
    for (size_t a = 0; a < 3; ++a) {
        e.position[a] = c.position[a]->values[row];
        e.scale[a] = c.scale[a] ? std::exp(c.scale[a]->values[row]) : 0;
        if (!c.rgb)
            e.color[a] = 0.5 + double(kHarmonic0) * c.harmonic[a]->values[row];
    }
    if (c.rgb)
        e.color = c.rgb->fractions(row);
    for (size_t a = 0; a < 4; ++a)
        e.rotation[a] = c.rotation[a]->values[row];
    e.opacity = 1 / (1 + std::exp(-c.opacity->values[row]));
    if (c.label && c.label->values[row] >= 0 && c.label->values[row] < kClassCount)
        e.label = static_cast<uint8_t>(c.label->values[row]);
    return e;
}

} // namespace

Result<SplatFile> read_splats_ply(const Path& path)
{
    const std::string where = quote_path(path);
    SR_TRY(const PlyFile file, read_ply(path));
    const PlyElement* vertices = file.find("vertex");
    if (!vertices)
        return fail(ErrorCode::bad_input, "{}: has no element vertex", where);
    std::vector<std::string> warnings;
    SR_TRY(SplatColumns columns, columns_of(*vertices, where, warnings));
    if (columns.label && !says_own_labels(file.comments))
        SR_CHECK(check_labels(columns, vertices->rows, where, warnings));
    EllipsoidFlattener flattener(where);
    for (size_t row = 0; row < vertices->rows; ++row) {
        flattener.add(ellipsoid_of(columns, row), !columns.scale[2]);
        if (std::ranges::any_of(columns.rest, [&](const PlyProperty* p) { return p->values[row] != 0; }))
            flattener.count_view_dependent();
    }
    SR_TRY(SplatFile splats, std::move(flattener).finish());
    splats.warnings.insert(splats.warnings.end(), warnings.begin(), warnings.end());
    return splats;
}

Splats turned_for_viewers(const Splats& splats)
{
    const auto turned = [](const std::array<float, 3>& p) { return std::array<float, 3>{p[1], -p[2], -p[0]}; };
    const auto along = [](const std::array<float, 3>& a, const std::array<float, 3>& b) {
        return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    };
    Splats s = splats;
    for (size_t i = 0; i < s.position.size(); ++i) {
        const Tangents before = tangents_of(splats.normal[i]);
        s.position[i] = turned(splats.position[i]);
        s.normal[i] = turned(splats.normal[i]);
        // the tangents follow from the normal: where two of its numbers are equal, others than the turned ones
        const Tangents after = tangents_of(s.normal[i]);
        const auto u = turned(before.u), v = turned(before.v);
        s.sigma_u[i] = std::hypot(splats.sigma_u[i] * along(u, after.u), splats.sigma_v[i] * along(v, after.u));
        s.sigma_v[i] = std::hypot(splats.sigma_u[i] * along(u, after.v), splats.sigma_v[i] * along(v, after.v));
    }
    return s;
}

// ---- .splat

Result<SplatFile> read_dot_splat(const Path& path)
{
    const std::string where = quote_path(path);
    SR_TRY(const MappedFile file, MappedFile::open(path));
    const auto bytes = file.bytes();
    if (bytes.empty() || bytes.size() % kDotSplatBytes)
        return fail(ErrorCode::bad_input, "{}: expected splats of 32 bytes, found {} bytes", where, bytes.size());
    EllipsoidFlattener flattener(where);
    for (size_t at = 0; at < bytes.size(); at += kDotSplatBytes) {
        std::array<float, 6> floats;
        std::array<uint8_t, 8> rest;
        std::memcpy(floats.data(), bytes.data() + at, 24);
        std::memcpy(rest.data(), bytes.data() + at + 24, 8);
        Ellipsoid e;
        for (size_t a = 0; a < 3; ++a) {
            e.position[a] = floats[a];
            e.scale[a] = floats[3 + a];
            e.color[a] = rest[a] / 255.0;
            e.rotation[a] = (rest[5 + a] - 128) / 128.0;
        }
        e.opacity = rest[3] / 255.0;
        e.rotation[3] = (rest[4] - 128) / 128.0;
        flattener.add(e);
    }
    return std::move(flattener).finish();
}

Status write_dot_splat(const Path& path, const Splats& s)
{
    SR_CHECK(check_splats(path, s));
    const auto byte = [](float v) { return static_cast<uint8_t>(std::lround(std::clamp(v, 0.f, 255.f))); };
    std::vector<std::byte> bytes(s.position.size() * kDotSplatBytes);
    for (size_t i = 0; i < s.position.size(); ++i) {
        const auto& p = s.position[i];
        const std::array<float, 6> floats = {p[0], p[1], p[2], s.sigma_u[i], s.sigma_v[i], kThinScale};
        std::array<uint8_t, 8> rest;
        const std::array<float, 4> q = splat_rotation(s.normal[i]);
        for (size_t a = 0; a < 3; ++a)
            rest[a] = byte(s.color[i][a] * 255);
        rest[3] = byte(s.opacity[i] * 255);
        for (size_t a = 0; a < 4; ++a)
            rest[4 + a] = byte(q[a] * 128 + 128);
        std::memcpy(bytes.data() + i * kDotSplatBytes, floats.data(), 24);
        std::memcpy(bytes.data() + i * kDotSplatBytes + 24, rest.data(), 8);
    }
    return write_file_atomically(path, bytes);
}

} // namespace semrover
