// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "kernels/fusion.h"
#include "tests/support/kernel_case.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

namespace semrover {
namespace kernel_tsdf_test {

using Vec = std::array<double, 3>;

double dot(const Vec& a, const Vec& b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
double length(const Vec& a)
{
    return std::sqrt(dot(a, a));
}

struct Camera {
    double fx, fy, cx, cy;
    std::array<Vec, 3> rotation; // rows: camera axes in the world
    Vec at;                      // voxels from the box's corner
    uint32_t width, height, first;

    Vec to_camera(const Vec& voxels, double voxel) const
    {
        const Vec d = {(voxels[0] - at[0]) * voxel, (voxels[1] - at[1]) * voxel, (voxels[2] - at[2]) * voxel};
        return {dot(rotation[0], d), dot(rotation[1], d), dot(rotation[2], d)};
    }
    Vec to_voxels(const Vec& q, double voxel) const
    {
        Vec v = at;
        for (size_t axis = 0; axis < 3; ++axis)
            v[axis] += (rotation[0][axis] * q[0] + rotation[1][axis] * q[1] + rotation[2][axis] * q[2]) / voxel;
        return v;
    }
};

// cameras that look at the middle of a box of blocks, with pictures of a bumpy surface there, holes, labels, colours
struct Pictures {
    std::vector<Camera> cameras;
    std::vector<float> table;
    std::vector<uint32_t> pixels; // [.., 2]

    Pictures(uint32_t frames, uint32_t blocks, const TsdfOptions& o, uint32_t seed)
    {
        std::mt19937 random(seed);
        const auto uniform = [&](double low, double high) {
            return low + (high - low) * double(random() % 65536) / 65536;
        };
        for (uint32_t i = 0; i < frames; ++i) {
            Camera c{};
            c.width = 23 + random() % 20;
            c.height = 17 + random() % 20;
            c.fx = c.width * uniform(0.7, 1);
            c.fy = c.fx * uniform(0.9, 1.1);
            c.cx = c.width * uniform(0.45, 0.55);
            c.cy = c.height * uniform(0.45, 0.55);
            const double half = 4.0 * blocks, away = 8.0 * blocks + 10;
            const double turn = uniform(-0.6, 0.6), tilt = uniform(-0.3, 0.3);
            const Vec z = {std::cos(turn) * std::cos(tilt), std::sin(turn) * std::cos(tilt), std::sin(tilt)};
            const Vec x = {std::sin(turn), -std::cos(turn), 0};
            const Vec y = {z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]};
            c.rotation = {x, y, z};
            for (size_t axis = 0; axis < 3; ++axis)
                c.at[axis] = half - away * z[axis];
            c.first = uint32_t(pixels.size() / 2);
            for (uint32_t p = 0; p < c.width * c.height; ++p) {
                const double u = p % c.width, v = p / c.width;
                double depth = away * o.voxel * (1 + 0.15 * std::sin(0.4 * u + i) * std::cos(0.3 * v)) + 0.02 * u;
                if (random() % 11 == 0)
                    depth += 3 * o.voxel; // a step
                const bool hole = random() % 13 == 0;
                const uint32_t label = random() % 4 == 0 ? 255 : random() % 20;
                pixels.push_back(std::bit_cast<uint32_t>(hole ? 0.f : float(depth)));
                pixels.push_back(uint32_t(random() & 0xffffff) | label << 24);
            }
            cameras.push_back(c);
            add_row(c);
        }
        table.resize(table.size() + kTsdfFrameWords); // one row without a frame
    }

  private:
    void add_row(const Camera& c)
    {
        const size_t at = table.size();
        table.resize(at + kTsdfFrameWords);
        float* row = &table[at];
        const double lens[] = {c.fx, c.fy, c.cx, c.cy};
        std::copy_n(lens, 4, row);
        for (size_t i = 0; i < 9; ++i)
            row[4 + i] = float(c.rotation[i / 3][i % 3]);
        for (size_t i = 0; i < 3; ++i) {
            row[13 + i] = std::bit_cast<float>(int32_t(std::floor(c.at[i])));
            row[16 + i] = float(c.at[i] - std::floor(c.at[i]));
        }
        row[19] = std::bit_cast<float>(c.width);
        row[20] = std::bit_cast<float>(c.height);
        row[21] = std::bit_cast<float>(c.first);
    }
};

struct Plane {
    Vec n{}; // 0: nothing
    uint32_t rgb = 0, label = 0;
    bool edge = false;
    bool certain = true; // no decision hangs on rounding

    bool valid() const { return n != Vec{}; }
};

Plane plane_of(const Pictures& pictures, const Camera& c, uint32_t u, uint32_t v, const TsdfOptions& o)
{
    const bool inner_x = u > 0 && u + 1 < c.width, inner_y = v > 0 && v + 1 < c.height;
    const auto inverse = [&](int x, int y) { // 0 for nothing, and for all neighbours across a border
        if ((x != int(u) && !inner_x) || (y != int(v) && !inner_y))
            return 0.0;
        const auto d = std::bit_cast<float>(pictures.pixels[2 * (c.first + uint32_t(y) * c.width + uint32_t(x))]);
        return d == 0 ? 0.0 : 1 / double(d);
    };
    const int x = int(u), y = int(v);
    const uint32_t at = c.first + v * c.width + u;
    const double w = inverse(x, y);
    Plane plane;
    if (w == 0 || 1 / w > o.max_depth)
        return plane;
    const auto minmod = [&](double before, double after) {
        const double b = w - before, a = after - w;
        return before == 0 || after == 0 || a * b <= 0 ? 0.0 : std::abs(a) < std::abs(b) ? a : b;
    };
    double a = minmod(inverse(x - 1, y), inverse(x + 1, y)), b = minmod(inverse(x, y - 1), inverse(x, y + 1));
    const double du = u + 0.5 - c.cx, dv = v + 0.5 - c.cy;
    plane.n = {a * c.fx, b * c.fy, w - a * du - b * dv};
    const double cosine = w / (length(plane.n) * length({du / c.fx, dv / c.fy, 1}));
    plane.certain = std::abs(cosine - 0.02) > 1e-4;
    if (cosine < 0.02) {
        a = b = 0;
        plane.n = {0, 0, w};
    }
    const auto off = [&](double predicted, double found) {
        if (found == 0 || predicted <= 0)
            return true;
        const double error = std::abs(1 / predicted - 1 / found);
        plane.certain = plane.certain && std::abs(error - 2 * double(o.voxel)) > 1e-4;
        return error > 2 * double(o.voxel);
    };
    for (const bool is_off : {off(w - a, inverse(x - 1, y)), off(w + a, inverse(x + 1, y)),
                              off(w - b, inverse(x, y - 1)), off(w + b, inverse(x, y + 1))})
        plane.edge = plane.edge || is_off;
    plane.rgb = pictures.pixels[2 * at + 1] & 0xffffff;
    plane.label = std::min(pictures.pixels[2 * at + 1] >> 24, 31u);
    return plane;
}

const TsdfOptions kOptions{.blocks_x = 2, .blocks_y = 2, .blocks_z = 2, .max_depth = 3.8f};

TEST(kernel_tsdf, planes_match_the_formula)
{
    const Pictures pictures(5, 2, kOptions, 3);
    KernelCase k(test_device());
    const Tensor y =
        tsdf_planes(k.graph, {k.input(pictures.table, kTsdfFrameWords), k.input(pictures.pixels, 2)}, kOptions);
    const Tensor out = k.output(y.rows, 4, DType::u32, 4);
    k.graph.keep(y, out);
    ASSERT_TRUE(k.compile_and_run());
    const auto got = k.read_array<uint32_t>(out);
    size_t nothing = 0, edges = 0;
    for (const Camera& c : pictures.cameras)
        for (uint32_t i = 0; i < c.width * c.height; ++i) {
            const Plane expect = plane_of(pictures, c, i % c.width, i / c.width, kOptions);
            if (!expect.certain)
                continue;
            const uint32_t* row = &got[4 * (c.first + i)];
            for (size_t axis = 0; axis < 3; ++axis)
                ASSERT_NEAR(std::bit_cast<float>(row[axis]), expect.n[axis], 2e-6 * (1 + length(expect.n))) << i;
            ASSERT_EQ(row[3] & 0x1fffffff, expect.valid() ? expect.rgb | expect.label << 24 : 0) << i;
            ASSERT_EQ(row[3] >> 31, expect.edge) << i;
            nothing += !expect.valid();
            edges += expect.edge;
        }
    EXPECT_GT(nothing, 100u);
    EXPECT_GT(edges, 100u);
}

TEST(kernel_tsdf, bits_are_ranked_and_listed)
{
    for (const uint32_t words : {1u, 33u, 1000u, 70001u})
        for (const uint32_t sparse : {1u, 7u}) {
            KernelCase k(test_device(), words);
            std::vector<uint32_t> bitmap = k.indices(words, ~0u);
            for (uint32_t i = 0; i < words; ++i)
                bitmap[i] = i % sparse == 0 ? bitmap[i] : 0;
            std::vector<uint32_t> ranks, list;
            for (uint32_t i = 0; i < words; ++i) {
                ranks.push_back(uint32_t(list.size()));
                for (uint32_t b = 0; b < 32; ++b)
                    if (bitmap[i] >> b & 1)
                        list.push_back(i * 32 + b);
            }
            const Tensor bits = k.input(bitmap), total = k.output(1, 1, DType::u32, 1);
            const Tensor out = k.output(words, 1, DType::u32, 1), blocks = k.output(32 * words, 1, DType::u32, 1);
            const PrefixSum ranked = tsdf_rank(k.graph, bits);
            k.graph.keep(ranked.sums, out);
            k.graph.keep(ranked.total, total);
            tsdf_list(k.graph, bits, out, blocks);
            ASSERT_TRUE(k.compile_and_run());
            EXPECT_EQ(k.read_array<uint32_t>(out), ranks);
            EXPECT_EQ(k.read_array<uint32_t>(total)[0], list.size());
            auto got = k.read_array<uint32_t>(blocks);
            got.resize(list.size());
            EXPECT_EQ(got, list);
        }
}

TEST(kernel_tsdf, blocks_near_a_surface_are_touched_and_none_that_are_far)
{
    const Pictures pictures(3, 2, kOptions, 5);
    KernelCase k(test_device());
    const Tensor frames = k.input(pictures.table, kTsdfFrameWords), pixels = k.input(pictures.pixels, 2);
    const Tensor bitmap = k.input(std::vector<uint32_t>(kOptions.bitmap_words()));
    tsdf_touch(k.graph, frames, tsdf_planes(k.graph, {frames, pixels}, kOptions), kOptions, bitmap);
    ASSERT_TRUE(k.compile_and_run());
    const uint32_t bits = k.read_array<uint32_t>(bitmap)[0];
    std::array<double, 8> nearest; // distance of the surface to each block's box, voxels
    nearest.fill(1e9);
    for (const Camera& c : pictures.cameras)
        for (uint32_t i = 0; i < c.width * c.height; ++i) {
            const Plane plane = plane_of(pictures, c, i % c.width, i / c.width, kOptions);
            if (!plane.valid())
                continue;
            const Vec ray = {(i % c.width + 0.5 - c.cx) / c.fx, (i / c.width + 0.5 - c.cy) / c.fy, 1};
            const double z = 1 / dot(plane.n, ray);
            const Vec v = c.to_voxels({ray[0] * z, ray[1] * z, z}, kOptions.voxel);
            for (uint32_t b = 0; b < 8; ++b) {
                Vec off{};
                for (size_t axis = 0; axis < 3; ++axis) {
                    const double low = 8 * (b >> axis & 1);
                    off[axis] = std::max({low - v[axis], v[axis] - low - 8, 0.0});
                }
                nearest[b] = std::min(nearest[b], length(off));
            }
        }
    for (uint32_t b = 0; b < 8; ++b) {
        if (nearest[b] < 1e-3) {
            EXPECT_TRUE(bits >> b & 1) << b;
        }
        if (nearest[b] > 4 + 8) { // truncation, and the pixel's own extent at a grazing angle
            EXPECT_FALSE(bits >> b & 1) << b;
        }
    }
    EXPECT_NE(bits, 0u);
}

TEST(kernel_tsdf, one_pixel_touches_its_truncation_and_no_more)
{
    // a camera in the middle of block (1, 1, 0), looking along x: the surface is 1.3 m ahead, 13 voxels
    const TsdfOptions o{.blocks_x = 4, .blocks_y = 3, .blocks_z = 1};
    std::vector<float> row(kTsdfFrameWords);
    const float values[] = {100, 100, 0.5, 0.5, 0, -1, 0, 0, 0, -1, 1, 0, 0};
    std::ranges::copy(values, row.begin());
    for (const auto& [at, v] : {std::pair{13, 12}, {14, 12}, {15, 4}, {19, 1}, {20, 1}})
        row[size_t(at)] = std::bit_cast<float>(int32_t(v));
    for (const auto& [depth, expect] :
         {std::pair{1.3f, 0b11000000u}, {0.65f, 0b01100000u}, {0.3f, 0b01100000u}, {0.35f, 0b01100000u}, {0.f, 0u}}) {
        KernelCase k(test_device());
        const Tensor frames = k.input(row, kTsdfFrameWords);
        const Tensor pixels = k.input(std::vector<uint32_t>{std::bit_cast<uint32_t>(depth), 0}, 2);
        const Tensor bitmap = k.input(std::vector<uint32_t>(1));
        tsdf_touch(k.graph, frames, tsdf_planes(k.graph, {frames, pixels}, o), o, bitmap);
        ASSERT_TRUE(k.compile_and_run());
        EXPECT_EQ(k.read_array<uint32_t>(bitmap)[0], expect) << depth;
    }
}

// what a voxel keeps, as the shader's head comment says it
struct Sums {
    std::array<double, kTsdfStateFields> fields{};
    std::array<uint32_t, 20> votes{};
    bool certain = true;
};

class Integration {
  public:
    Integration(const Pictures& pictures, const TsdfOptions& o) : pictures_(pictures), o_(o) {}

    Sums of(const std::array<uint32_t, 3>& voxel)
    {
        Sums s;
        for (const Camera& c : pictures_.cameras)
            add(c, {voxel[0] + 0.5, voxel[1] + 0.5, voxel[2] + 0.5}, s);
        return s;
    }

  private:
    void decide(double value, double limit, Sums& s) const { s.certain = s.certain && std::abs(value - limit) > 2e-5; }

    // of the pixel that a point projects to; `ray` goes through the pixel's centre
    Plane look(const Camera& c, const Vec& q, Vec& ray, Sums& s) const
    {
        const double u = q[0] / q[2] * c.fx + c.cx, v = q[1] / q[2] * c.fy + c.cy;
        decide(u, std::round(u), s);
        decide(v, std::round(v), s);
        if (!(u >= 0 && v >= 0 && u < c.width && v < c.height))
            return {};
        ray = {(std::floor(u) + 0.5 - c.cx) / c.fx, (std::floor(v) + 0.5 - c.cy) / c.fy, 1};
        const Plane plane = plane_of(pictures_, c, uint32_t(u), uint32_t(v), o_);
        s.certain = s.certain && plane.certain;
        return plane;
    }

    void add(const Camera& c, const Vec& sample, Sums& s) const
    {
        const double voxel = o_.voxel, truncation = o_.truncation, band = o_.band;
        const Vec q = c.to_camera(sample, voxel);
        if (q[2] <= 0.05 || q[2] > o_.max_depth + truncation)
            return;
        Vec center{};
        Plane plane = look(c, q, center, s);
        const Vec& n = plane.n;
        const Vec ray = {q[0] / q[2], q[1] / q[2], 1};
        const double along = dot(n, ray), scale = length(n);
        if (!plane.valid() || along <= 0)
            return;
        if (plane.edge) {
            const double shift = std::abs(1 / along - 1 / dot(n, center));
            decide(shift, voxel, s);
            if (shift > voxel)
                return;
        }
        const double d = (1 - dot(n, q)) / scale;
        decide(d, -band, s);
        decide(q[2] - 1 / along, 2 * truncation, s);
        if (d < -band || q[2] - 1 / along > 2 * truncation)
            return;
        double w = std::max(along / (scale * length(ray)), 0.1) / (1 + 1 / along);
        if (d < 0)
            w *= 1 + 0.9 * d / band;
        s.fields[0] += w * std::min(d / truncation, 1.0);
        s.fields[1] += w;
        decide(std::abs(d), band, s);
        if (std::abs(d) > band)
            return;
        const Vec foot = {q[0] + n[0] * d / scale, q[1] + n[1] * d / scale, q[2] + n[2] * d / scale};
        const Plane other = foot[2] > 0.05 ? look(c, foot, center, s) : Plane{};
        decide(std::abs(1 - dot(other.n, foot)), 0.5 * voxel * length(other.n), s);
        if (std::abs(1 - dot(other.n, foot)) <= 0.5 * voxel * length(other.n) && dot(other.n, foot) > 0)
            plane = other;
        for (uint32_t channel = 0; channel < 3; ++channel)
            s.fields[2 + channel] += w * (plane.rgb >> (8 * channel) & 255);
        s.fields[5] += w;
        s.fields[6] += 1;
        const double size = voxel * along, pixels = c.fx * c.fy * size * size * along / (scale * length(ray));
        decide(pixels, std::max(std::round(pixels), 1.0), s);
        if (plane.label < 20)
            s.votes[plane.label] += uint32_t(std::clamp(std::ceil(pixels), 1.0, 16.0));
    }

    const Pictures& pictures_;
    const TsdfOptions& o_;
};

TEST(kernel_tsdf, integration_matches_the_formula_in_one_pass_or_several)
{
    struct Case {
        uint32_t frames;
        std::vector<uint32_t> blocks;
    };
    for (const Case& c : {Case{1, {0}}, Case{2, {3, 5, 6}}, Case{7, {0, 1, 2, 3, 4, 5, 6, 7}}}) {
        SCOPED_TRACE(fmt::format("{} frames, {} blocks", c.frames, c.blocks.size()));
        const Pictures pictures(c.frames, 2, kOptions, 11 + c.frames);
        const uint32_t count = uint32_t(c.blocks.size());
        KernelCase k(test_device());
        const Tensor frames = k.input(pictures.table, kTsdfFrameWords), pixels = k.input(pictures.pixels, 2);
        const TsdfState state{k.input(c.blocks), k.input(std::vector<float>(count * 512 * kTsdfStateFields)),
                              k.input(std::vector<uint32_t>(count * 512 * kTsdfVoteWords))};
        const Tensor planes = tsdf_planes(k.graph, {frames, pixels}, kOptions);
        tsdf_integrate(k.graph, frames, planes, kOptions, state);
        ASSERT_TRUE(k.compile_and_run());
        const auto sums = k.read_array<float>(state.state);
        const auto votes = k.read_array<uint32_t>(state.votes);
        Integration integration(pictures, kOptions);
        size_t certain = 0, seen = 0;
        for (uint32_t i = 0; i < count * 512; ++i) {
            const uint32_t b = c.blocks[i / 512], l = i % 512;
            const Sums expect =
                integration.of({(b & 1) * 8 + l % 8, (b >> 1 & 1) * 8 + l / 8 % 8, (b >> 2) * 8 + l / 64});
            if (!expect.certain)
                continue;
            ++certain;
            seen += expect.fields[1] > 0;
            for (uint32_t f = 0; f < kTsdfStateFields; ++f) {
                const double scale = f >= 2 && f < 5 ? 255 : 1;
                ASSERT_NEAR(sums[(i / 512 * kTsdfStateFields + f) * 512 + l], expect.fields[f],
                            1e-4 * scale * c.frames) // a distance is the difference of two of about 3 m
                    << "voxel " << i << " field " << f;
            }
            for (uint32_t label = 0; label < 20; ++label)
                ASSERT_EQ(votes[(i / 512 * kTsdfVoteWords + label / 2) * 512 + l] >> (label % 2 * 16) & 0xffff,
                          expect.votes[label]);
        }
        EXPECT_GT(certain, count * 512 * 98 / 100);
        EXPECT_GT(seen, count * 512 / 4);
        // again on top of it: twice the votes
        ASSERT_TRUE(k.compile_and_run());
        const auto twice = k.read_array<uint32_t>(state.votes);
        for (size_t i = 0; i < votes.size(); ++i)
            ASSERT_EQ(twice[i], 2 * votes[i]);
    }
}

TEST(kernel_tsdf, finished_voxels_have_the_label_with_most_votes_and_ties_go_to_the_lower)
{
    KernelCase k(test_device(), 9);
    const uint32_t blocks = 3, voxels = blocks * 512;
    std::vector<float> sums(voxels * kTsdfStateFields);
    std::vector<uint32_t> votes(voxels * kTsdfVoteWords);
    const std::vector<uint32_t> random = k.indices(voxels * 40, 1000);
    const auto field = [&](uint32_t i, uint32_t f) -> float& {
        return sums[(i / 512 * kTsdfStateFields + f) * 512 + i % 512];
    };
    std::vector<uint32_t> expect;
    for (uint32_t i = 0; i < voxels; ++i) {
        const uint32_t* r = &random[i * 40];
        field(i, 1) = r[0] < 100 ? 0 : float(r[0]) / 1000;
        field(i, 0) = field(i, 1) * (float(r[1]) / 500 - 1);
        field(i, 5) = r[2] < 100 ? 0 : 0.5f;
        field(i, 6) = float(r[3] % 12);
        uint32_t rgb = 0, label = 31, best = 0;
        for (uint32_t c = 0; c < 3; ++c) {
            field(i, 2 + c) = 0.5f * float(r[4 + c] % 256);
            rgb |= field(i, 5) > 0 ? r[4 + c] % 256 << (8 * c) : 0;
        }
        for (uint32_t c = 0; c < 20; ++c) {
            const uint32_t n = r[7] < 50 ? 0 : r[7] < 100 ? 65535 : r[8 + c] % 4; // none; all full; ties
            votes[(i / 512 * kTsdfVoteWords + c / 2) * 512 + i % 512] |= n << (c % 2 * 16);
            if (n > best) {
                best = n;
                label = c;
            }
        }
        expect.push_back(rgb | label << 24 | std::min(r[3] % 12, 7u) << 29);
    }
    TsdfOptions options = kOptions;
    options.min_weight = 0.3f;
    const TsdfState state{k.input(std::vector<uint32_t>(blocks)), k.input(sums), k.input(votes)};
    const Tensor distances = k.output(voxels, 1, DType::f32, 1), attributes = k.output(voxels, 1, DType::u32, 1);
    tsdf_finish(k.graph, state, options, distances, attributes);
    ASSERT_TRUE(k.compile_and_run());
    EXPECT_EQ(k.read_array<uint32_t>(attributes), expect);
    const auto d = k.read_array<float>(distances);
    for (uint32_t i = 0; i < voxels; ++i)
        ASSERT_NEAR(d[i], field(i, 1) < 0.3f ? 2 : float(random[i * 40 + 1]) / 500 - 1, 1e-6) << i;
}

TEST(kernel_tsdf, a_counter_stops_at_65535)
{
    // one pixel fills the view, its label 4; the counter of 4 is nearly full, that of 5 shares its word
    const TsdfOptions o;
    std::vector<float> row(kTsdfFrameWords);
    const float values[] = {1, 1, 0.5, 0.5, 0, -1, 0, 0, 0, -1, 1, 0, 0};
    std::ranges::copy(values, row.begin());
    for (const auto& [at, v] : {std::pair{13, -6}, {14, 4}, {15, 4}, {19, 1}, {20, 1}})
        row[size_t(at)] = std::bit_cast<float>(int32_t(v));
    KernelCase k(test_device());
    const Tensor frames = k.input(row, kTsdfFrameWords);
    const Tensor pixels = k.input(std::vector<uint32_t>{std::bit_cast<uint32_t>(1.f), 4 << 24}, 2);
    std::vector<uint32_t> votes(512 * kTsdfVoteWords);
    std::fill_n(votes.begin() + 2 * 512, 512, 65534u | 7u << 16);
    const TsdfState state{k.input(std::vector<uint32_t>{0}), k.input(std::vector<float>(512 * kTsdfStateFields)),
                          k.input(votes)};
    tsdf_integrate(k.graph, frames, tsdf_planes(k.graph, {frames, pixels}, o), o, state);
    for (const uint32_t expect : {65535u, 65535u}) {
        ASSERT_TRUE(k.compile_and_run());
        EXPECT_EQ(k.read_array<uint32_t>(state.votes)[2 * 512 + 4 + 4 * 8 + 4 * 64], expect | 7u << 16);
    }
}

} // namespace kernel_tsdf_test
} // namespace semrover
