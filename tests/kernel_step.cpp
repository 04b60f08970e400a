// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "kernels/sampling.h"
#include "shaders/lib/step_row.h"
#include "tests/support/kernel_case.h"
#include "tests/support/philox_reference.h"

#include <algorithm>
#include <cmath>

namespace semrover {
namespace kernel_step_test {

constexpr uint64_t kSeed = 0x123456789abcdef0;

std::vector<uint32_t> words_of(const std::vector<StepRow>& rows)
{
    std::vector<uint32_t> words(rows.size() * sizeof(StepRow) / 4);
    std::memcpy(words.data(), rows.data(), words.size() * 4);
    return words;
}

StepTable table(KernelCase& k, const std::vector<StepRow>& rows, uint32_t current, uint32_t first_timestep = 0)
{
    return {k.input(words_of(rows), 16), k.input(std::vector<uint32_t>{current, first_timestep})};
}

// rows of which only one has the numbers that a test wants
std::vector<StepRow> one_of_three(const StepRow& row)
{
    StepRow other{};
    other.c_x = other.c_z = other.in_scale = 7;
    other.draw = 99;
    return {other, row, other};
}

void run(KernelCase& k)
{
    const Status status = k.compile_and_run();
    ASSERT_TRUE(status) << status.error().message;
}

TEST(kernel_step_advance, counts_runs)
{
    KernelCase k(test_device());
    const Tensor clock = k.input(std::vector<uint32_t>{5, 11});
    for (int i = 0; i < 3; ++i)
        step_advance(k.graph, clock);
    run(k);
    EXPECT_EQ(k.read_array<uint32_t>(clock), (std::vector<uint32_t>{8, 11}));
}

TEST(kernel_step_timestep, gives_every_token_the_row_of_the_current_timestep)
{
    for (uint32_t rows : {1u, 64u, 131u}) {
        KernelCase k(test_device());
        StepRow row{};
        row.timestep_index = 17;
        const Tensor out = k.output(rows, 1, DType::u32, 1);
        step_timestep(k.graph, table(k, one_of_three(row), 1, 10), out);
        run(k);
        EXPECT_EQ(k.read_array<uint32_t>(out), std::vector<uint32_t>(rows, 7));
    }
}

TEST(kernel_step_input, scales_the_state_once_per_guidance_half)
{
    for (DType dtype : {DType::f32, DType::f16})
        for (auto [rows, cols, halves] : {std::array{1u, 1u, 1u}, {3u, 64u, 2u}, {25u, 13u, 2u}}) {
            KernelCase k(test_device());
            StepRow row{};
            row.in_scale = 0.625f;
            const HostMatrix x = k.random(rows, cols, DType::f32);
            const HostMatrix got =
                k.run(step_input(k.graph, table(k, one_of_three(row), 1), k.input(x), halves * rows, dtype));
            for (uint32_t r = 0; r < halves * rows; ++r)
                for (uint32_t c = 0; c < cols; ++c)
                    ASSERT_NEAR(got.at(r, c), 0.625 * x.at(r % rows, c), dtype == DType::f16 ? 2e-3 : 1e-7);
            k.expect_zero_padding(got);
        }
}

TEST(kernel_step_noise, has_a_reference_that_knows_the_answers_of_random123)
{
    // kat_vectors of Random123 1.14, "philox4x32 10"
    EXPECT_EQ(philox_reference({0, 0, 0, 0}, {0, 0}), (Words4{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
    EXPECT_EQ(philox_reference({~0u, ~0u, ~0u, ~0u}, {~0u, ~0u}),
              (Words4{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
    EXPECT_EQ(philox_reference({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
              (Words4{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

struct Tokens {
    std::vector<int32_t> cells; // [rows, 4]
    std::vector<uint32_t> known;
};

Tokens tokens(uint32_t rows)
{
    Tokens t;
    for (uint32_t r = 0; r < rows; ++r) {
        t.cells.insert(t.cells.end(), {int32_t(r % 50) - 20, int32_t(r / 50) - 9, int32_t(r % 7), 12345});
        t.known.push_back(r % 3 == 0);
    }
    return t;
}

HostMatrix noise(const Tokens& t, const StepRow& row, uint32_t cols, uint64_t seed = kSeed)
{
    KernelCase k(test_device());
    const StepTable steps = table(k, one_of_three(row), 1);
    return k.run(step_noise(k.graph, steps, k.input(t.cells, 4), k.input(t.known), cols, seed));
}

StepRow noise_row(uint32_t draw, uint32_t stream)
{
    StepRow row{};
    row.draw = draw;
    row.noise_stream = stream;
    return row;
}

void expect_reference(const HostMatrix& z, const Tokens& t, const StepRow& row)
{
    for (uint32_t r = 0; r < z.rows; ++r)
        for (uint32_t c = 0; c < z.cols; ++c) {
            const uint32_t stream = row.noise_stream == 2 ? 2 : t.known[r];
            const Words4 counter{uint32_t(t.cells[4 * r]), uint32_t(t.cells[4 * r + 1]), uint32_t(t.cells[4 * r + 2]),
                                 row.draw << 12 | stream << 10 | c / 4};
            const double expected =
                normals_reference(philox_reference(counter, {uint32_t(kSeed), uint32_t(kSeed >> 32)}))[c % 4];
            ASSERT_NEAR(z.at(r, c), expected, 2e-6) << "row " << r << " channel " << c;
        }
}

TEST(kernel_step_noise, matches_box_muller_in_double)
{
    for (auto [rows, cols] : {std::array{1u, 1u}, {3u, 64u}, {37u, 13u}, {131u, 200u}, {2u, kNoiseChannels}})
        for (uint32_t stream : {0u, 2u}) {
            SCOPED_TRACE(fmt::format("[{}, {}] stream {}", rows, cols, stream));
            const StepRow row = noise_row(249, stream);
            const HostMatrix z = noise(tokens(rows), row, cols);
            expect_reference(z, tokens(rows), row);
            KernelCase(test_device()).expect_zero_padding(z);
        }
}

TEST(kernel_step_noise, has_the_moments_of_a_normal_and_uncorrelated_neighbours)
{
    const HostMatrix z = noise(tokens(500), noise_row(3, 0), 200);
    double moments[4] = {}, neighbours = 0, largest = 0;
    for (uint32_t r = 0; r < z.rows; ++r)
        for (uint32_t c = 0; c < z.cols; ++c) {
            double power = 1;
            for (double& moment : moments)
                moment += (power *= z.at(r, c)) / 1e5;
            neighbours += double(z.at(r, c)) * z.at(r, (c + 1) % z.cols) / 1e5;
            largest = std::max(largest, double(std::abs(z.at(r, c))));
        }
    // five standard errors of 1e5 draws each
    EXPECT_NEAR(moments[0], 0, 5 * std::sqrt(1 / 1e5));
    EXPECT_NEAR(moments[1], 1, 5 * std::sqrt(2 / 1e5));
    EXPECT_NEAR(moments[2], 0, 5 * std::sqrt(15 / 1e5));
    EXPECT_NEAR(moments[3], 3, 5 * std::sqrt(96 / 1e5));
    EXPECT_NEAR(neighbours, 0, 5 * std::sqrt(1 / 1e5));
    EXPECT_GT(largest, 3.8); // tails are there
    EXPECT_LT(largest, 5.8); // sqrt(2 * 24 ln 2), the longest radius
}

TEST(kernel_step_noise, gives_a_cell_the_same_bits_in_any_row)
{
    const Tokens all = tokens(100);
    Tokens reversed;
    for (uint32_t r = 100; r-- > 3;) { // another order, another batch size
        reversed.cells.insert(reversed.cells.end(), &all.cells[4 * r], &all.cells[4 * r + 4]);
        reversed.known.push_back(all.known[r]);
    }
    const HostMatrix z = noise(all, noise_row(8, 0), 13), other = noise(reversed, noise_row(8, 0), 13);
    for (uint32_t r = 3; r < 100; ++r)
        for (uint32_t c = 0; c < 13; ++c)
            ASSERT_EQ(z.at(r, c), other.at(99 - r, c)) << "row " << r;
}

TEST(kernel_step_noise, changes_with_the_draw_the_seed_the_stream_and_whether_a_token_is_known)
{
    Tokens t = tokens(1);
    const float base = noise(t, noise_row(1, 0), 1).at(0, 0);
    EXPECT_NE(base, noise(t, noise_row(2, 0), 1).at(0, 0));
    EXPECT_NE(base, noise(t, noise_row(1, 2), 1).at(0, 0));
    EXPECT_NE(base, noise(t, noise_row(1, 0), 1, kSeed + 1).at(0, 0));
    EXPECT_NE(base, noise(t, noise_row(1, 0), 1, kSeed + (uint64_t(1) << 32)).at(0, 0));
    t.known[0] ^= 1;
    EXPECT_NE(base, noise(t, noise_row(1, 0), 1).at(0, 0));
}

TEST(kernel_step_renoise, mixes_the_state_with_noise_in_place)
{
    for (auto [rows, cols] : {std::array{1u, 1u}, {24u, 64u}, {25u, 13u}}) {
        KernelCase k(test_device());
        StepRow row{};
        row.c_x = 0.8f;
        row.c_z = 0.6f;
        const HostMatrix x = k.random(rows, cols, DType::f32), z = k.random(rows, cols, DType::f32);
        const Tensor state = k.input(x);
        step_renoise(k.graph, table(k, one_of_three(row), 1), k.input(z), state);
        run(k);
        const HostMatrix got = k.read(state);
        for (uint32_t r = 0; r < rows; ++r)
            for (uint32_t c = 0; c < cols; ++c)
                ASSERT_NEAR(got.at(r, c), double(row.c_x) * x.at(r, c) + double(row.c_z) * z.at(r, c), 1e-6);
        k.expect_zero_padding(got);
    }
}

TEST(kernel_step_hold, puts_known_tokens_back_and_leaves_the_others)
{
    for (auto [rows, cols] : {std::array{1u, 1u}, {24u, 64u}, {25u, 13u}}) {
        KernelCase k(test_device());
        const HostMatrix x = k.random(rows, cols, DType::f32), fixed = k.random(rows, cols, DType::f32);
        std::vector<uint32_t> known(rows);
        for (uint32_t r = 0; r < rows; ++r)
            known[r] = r % 3 == 0;
        const Tensor state = k.input(x);
        step_hold(k.graph, k.input(known), k.input(fixed), state);
        run(k);
        const HostMatrix got = k.read(state);
        for (uint32_t r = 0; r < rows; ++r)
            for (uint32_t c = 0; c < cols; ++c)
                ASSERT_EQ(got.at(r, c), known[r] ? fixed.at(r, c) : x.at(r, c));
        k.expect_zero_padding(got);
    }
}

struct UpdateCase {
    uint32_t rows, cols;
    bool guided;
    float guidance, clip;
    float last_guidance = guidance; // linear over the frames
    uint32_t frames = 1;
};
const UpdateCase kUpdates[] = {
    {1, 1, false, 1, 3e38f}, {24, 64, true, 3, 3e38f},         {25, 13, true, 7.5f, 1},       {131, 72, false, 0, 1.5f},
    {7, 200, true, 0, 2},    {96, 4, true, 1, 3e38f, 2.5f, 6}, {48, 12, true, 3, 3e38f, 0, 3}};

StepRow update_row()
{
    StepRow s{};
    s.x0_x = 1.3f, s.x0_m = -0.7f;
    s.c_x0 = 0.4f, s.c_x = 0.5f, s.c_m = -0.2f, s.c_prev = 0.3f, s.c_z = 0.6f, s.c_z_color = 0.8f;
    s.known_scale = 0.9f, s.known_noise = 0.43f;
    return s;
}

struct UpdateInputs {
    HostMatrix m, z, fixed, x, x0;
    std::vector<uint32_t> known;
};

// next state and prediction of one element, in double
std::pair<double, double> update_reference(const UpdateCase& u, const UpdateInputs& in, uint32_t r, uint32_t c)
{
    const StepRow s = update_row();
    double m = in.m.at(r, c), guidance = u.guidance;
    if (u.frames > 1)
        guidance += (double(u.last_guidance) - u.guidance) * (r / (u.rows / u.frames)) / (u.frames - 1);
    if (u.guided)
        m = in.m.at(u.rows + r, c) + guidance * (m - in.m.at(u.rows + r, c));
    const double x0 = std::clamp(double(s.x0_x) * in.x.at(r, c) + double(s.x0_m) * m, -double(u.clip), double(u.clip));
    double next = double(s.c_x0) * x0 + double(s.c_x) * in.x.at(r, c) + double(s.c_m) * m +
                  double(s.c_prev) * in.x0.at(r, c) + double(c % 6 < 3 ? s.c_z : s.c_z_color) * in.z.at(r, c);
    if (in.known[r])
        next = double(s.known_scale) * in.fixed.at(r, c) + double(s.known_noise) * in.z.at(r, c);
    return {next, x0};
}

void check(const UpdateCase& u)
{
    SCOPED_TRACE(fmt::format("[{}, {}] guided {} {} clip {}", u.rows, u.cols, u.guided, u.guidance, u.clip));
    KernelCase k(test_device());
    UpdateInputs in;
    in.m = k.random(u.rows * (u.guided ? 2 : 1), u.cols, DType::f32);
    for (HostMatrix* matrix : {&in.z, &in.fixed, &in.x, &in.x0})
        *matrix = k.random(u.rows, u.cols, DType::f32);
    in.known = k.indices(u.rows, 2);
    const Tensor x = k.input(in.x), x0 = k.input(in.x0);
    step_update(k.graph, table(k, one_of_three(update_row()), 1), k.input(in.m), k.input(in.z), k.input(in.known),
                k.input(in.fixed), x, x0, {u.guidance, u.last_guidance, u.frames}, u.clip);
    run(k);
    const HostMatrix next = k.read(x), start = k.read(x0);
    for (uint32_t r = 0; r < u.rows; ++r)
        for (uint32_t c = 0; c < u.cols; ++c) {
            const auto [expected_next, expected_start] = update_reference(u, in, r, c);
            ASSERT_NEAR(next.at(r, c), expected_next, 1e-5) << "row " << r << " column " << c; // terms reach 40
            ASSERT_NEAR(start.at(r, c), expected_start, 1e-5) << "row " << r << " column " << c;
        }
    k.expect_zero_padding(next);
}

TEST(kernel_step_update, follows_the_formula_in_double_with_guidance_known_tokens_and_clip)
{
    for (const UpdateCase& u : kUpdates)
        check(u);
}

} // namespace kernel_step_test
} // namespace semrover
