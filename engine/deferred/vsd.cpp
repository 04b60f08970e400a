// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/deferred/vsd.h"

#include "engine/deferred/frame_slots.h"
#include "engine/model/renderer_model.h"
#include "engine/sampling/guidance.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Cholesky>

namespace semrover {

namespace {

static_assert(kMostWindowFrames == kMostFrames);
constexpr uint32_t kFirstRows = 1; // rows of the step table before the plan's: the first state

uint32_t video_halves(const VsdOptions& o)
{
    return o.first_guidance == 1.f && o.last_guidance == 1.f ? 1 : 2;
}

} // namespace

struct VsdRenderer::WindowMemory : Denoiser::Memory {
    const VsdOptions& options;
    DeviceTensor numbers, frame_table, frame_row; // of the frames; the table is computed once; row of it of each image
    DeviceTensor first, fixed;                    // noise of the first state; latents of the known frames
    DeviceTensor weights;                         // known_frame_weights(), where they are carried
    DeviceTensor velocity;                        // of every half, where they are apart

    WindowMemory(const Unet& u, const SamplingPlan& p, uint32_t text_tokens, const LatentSize& size, uint32_t count,
                 const VsdOptions& o)
        : Memory(u, p, {size, count, video_halves(o), kFirstRows, text_tokens}, o.seed), options(o)
    {
        numbers = state.tensor(frames, 1, DType::f32, "frame numbers", 1);
        frame_table = state.tensor(frames, unet.frame_width(), DType::f32, "frames");
        frame_row = state.tensor(halves * frames, 1, DType::u32, "frame_row", 1);
        first = latent("first noise");
        fixed = latent("known frames");
        if (o.correlation > 0)
            weights = state.tensor(uint32_t(p.rows.size()) * frames, frames, DType::f32, "weights", frames);
        if (apart())
            velocity = state.tensor(halves * rows(), channels, DType::f32, "velocity");
    }
    bool apart() const { return options.halves_apart && halves > 1; }

    // also what depends on the frame's number only
    Graph tables_graph(const DeviceLimits& limits) const override
    {
        Graph g = Memory::tables_graph(limits);
        g.keep(unet.frame_table(g, numbers.in(g)), frame_table);
        return g;
    }
    // the first state
    Graph begin_graph(const DeviceLimits& limits) const override
    {
        Graph g(limits);
        const StepTable s = tables.in(g);
        const Tensor state_x = x.in(g);
        step_hold(g, known.in(g), fixed.in(g), state_x);
        step_renoise(g, s, options.noise ? first.in(g) : g.keep(normals(g, s), first), state_x);
        step_advance(g, s.clock);
        return g;
    }
    // [videos * rows, in_channels] of that many halves -> velocity, fp32. Every image and video is at the same
    // timestep.
    Tensor forward(Graph& g, Tensor in, uint32_t videos) const
    {
        const uint32_t images = videos * frames;
        const Tensor row = table_row.in(g);
        const FrameEmbedding embedding{frames, frame_table.in(g), frame_row.in(g).row_range(0, images)};
        return unet
            .forward(g, {in, images, height, width}, tables.times.in(g), row.row_range(0, images), tables.context(g),
                     {embedding, row.row_range(0, videos)})
            .data;
    }
    Tensor evaluate(Graph& g, Tensor in) const
    {
        if (!apart())
            return forward(g, in, halves);
        g.keep_order();
        for (uint32_t half = 0; half < halves; ++half)
            g.keep(forward(g, in.row_range(half * rows(), rows()), 1), velocity.row_range(half * rows(), rows()));
        return velocity.in(g);
    }
    Graph step_graph(const DeviceLimits& limits) const override
    {
        Graph g(limits);
        const StepTable s = tables.in(g);
        const Tensor state_x = x.in(g), row = table_row.in(g);
        const RendererFrame seen{{}, buffer.in(g), visible.in(g)};
        step_timestep(g, s, row);
        const Tensor in = renderer_input(g, s, state_x, seen, halves, unet.precision());
        const FrameGuidance guidance(options.first_guidance, options.last_guidance, frames);
        step_update(g, s, evaluate(g, in), draws_noise(plan) ? normals(g, s) : first.in(g), known.in(g), fixed.in(g),
                    state_x, x0.in(g), guidance, float(plan.clip));
        if (weights.valid())
            step_carry(g, s, {weights.in(g), frames, kFirstRows}, known.in(g), fixed.in(g), state_x, x0.in(g));
        step_advance(g, s.clock);
        return g;
    }
};

VsdRenderer::VsdRenderer(Device& device, const SamplingPlan& plan, VsdOptions options)
    : Denoiser(device, plan), options_(std::move(options))
{
}

namespace {

Status check_video_renderer(const Unet& unet, const Conditioning& conditioning, uint32_t frames,
                            const VsdOptions& options)
{
    SR_CHECK(check_guidance(options.first_guidance));
    SR_CHECK(check_guidance(options.last_guidance));
    if (!(options.correlation >= 0 && options.correlation < 1))
        return fail(ErrorCode::usage, "a correlation of {} between frames, expected 0 to less than 1",
                    options.correlation);
    if (frames < 1 || frames > kMostFrames)
        return fail(ErrorCode::usage, "a window of {} frames, expected 1 to {}", frames, kMostFrames);
    const UnetConfig& c = unet.config();
    if (!c.video)
        return fail(ErrorCode::bad_input, "the UNet is one of single images, the video renderer wants one of videos");
    if (c.in_channels != 2 * c.out_channels + 1)
        return fail(ErrorCode::bad_input,
                    "the UNet takes {} channels, the video renderer gives it {}: noisy and buffer latent of {} each, "
                    "and visibility",
                    c.in_channels, 2 * c.out_channels + 1, c.out_channels);
    if (conditioning.added.size() != c.added_numbers)
        return fail(ErrorCode::bad_input, "the UNet takes {} numbers with a video, not {}", c.added_numbers,
                    conditioning.added.size());
    return {};
}

} // namespace

Result<std::unique_ptr<VsdRenderer>> VsdRenderer::create(Device& device, const Unet& unet, const SamplingPlan& plan,
                                                         const Conditioning& conditioning, const LatentSize& size,
                                                         uint32_t frames, VsdOptions options, SharedArena arena)
{
    SR_CHECK(check_video_renderer(unet, conditioning, frames, options));
    std::unique_ptr<VsdRenderer> r(new VsdRenderer(device, plan, std::move(options)));
    auto memory = std::make_unique<WindowMemory>(unet, r->plan_, conditioning.tokens, size, frames, r->options_);
    r->window_ = memory.get();
    StepRow first = first_noise_row(r->plan_.init_noise_sigma, kFirstDraw);
    first.c_x = float(r->plan_.init_known_scale); // x is zero but where a frame is known
    SR_CHECK(r->make(std::move(memory), {&first, 1}, conditioning, std::move(arena)));
    return r;
}

Result<PartBytes> VsdRenderer::planned_bytes(const DeviceLimits& limits, const Unet& unet, const SamplingPlan& plan,
                                             uint32_t text_tokens, const LatentSize& size, uint32_t frames,
                                             const VsdOptions& options)
{
    return WindowMemory(unet, plan, text_tokens, size, frames, options).planned(limits);
}

Status VsdRenderer::write_tables() const
{
    const WindowMemory& m = *window_;
    std::vector<float> numbers;
    std::vector<uint32_t> frame_rows;
    for (uint32_t f = 0; f < m.frames; ++f)
        numbers.push_back(float(f));
    for (uint32_t i = 0; i < m.halves * m.frames; ++i)
        frame_rows.push_back(i % m.frames);
    SR_CHECK(m.numbers.write(device_, numbers));
    return m.frame_row.write(device_, frame_rows);
}

Status VsdRenderer::upload(const DenoiserWindow& w) const
{
    const WindowMemory& m = *window_;
    const size_t frame = size_t(m.pixels) * m.channels, known = w.known.size() / frame;
    SR_ASSERT(w.known.size() == known * frame && known <= m.frames, "{} values known of {} frames of {} pixels",
              w.known.size(), m.frames, m.pixels);
    SR_CHECK(m.fixed.clear(device_));
    for (uint32_t f = 0; f < known; ++f)
        SR_CHECK(frame_of(m.fixed, m.frames, f).write_rows(device_, w.known.subspan(f * frame, frame)));
    std::vector<uint32_t> is_known(m.rows(), 0);
    std::fill_n(is_known.begin(), known * m.image_rows, 1u);
    SR_CHECK(m.known.write(device_, is_known));
    if (m.weights.valid())
        SR_CHECK(m.weights.write(device_, known_frame_weights(plan_, m.frames, uint32_t(known), options_.correlation)));
    if (!options_.noise)
        return {};
    std::vector<float> noise(w.buffers.size());
    options_.noise(w.number, noise);
    return write_frames(device_, m.first, m.frames, noise);
}

std::vector<float> known_frame_weights(const SamplingPlan& plan, uint32_t frames, uint32_t known, double correlation)
{
    std::vector<float> weights(plan.rows.size() * frames * frames, 0.f);
    if (known == 0 || known == frames)
        return weights;
    Eigen::MatrixXd before(frames, frames); // covariance of the frames
    for (uint32_t i = 0; i < frames; ++i)
        for (uint32_t j = 0; j < frames; ++j)
            before(i, j) = std::pow(correlation, i > j ? i - j : j - i);
    for (size_t row = 0; row < plan.rows.size(); ++row) {
        const double abar = plan.rows[row].coefficients.abar, noise = (1 - abar) / abar; // variance, of the frames' 1
        Eigen::MatrixXd noisy = before;
        noisy.diagonal().array() += noise;
        // covariance given the noisy frames, but for the factor `noise`
        const Eigen::MatrixXd given = noisy.llt().solve(before);
        const Eigen::MatrixXd carry =
            given.topLeftCorner(known, known).ldlt().solve(given.topRightCorner(known, frames - known));
        for (uint32_t u = known; u < frames; ++u)
            for (uint32_t k = 0; k < known; ++k)
                weights[(row * frames + u) * frames + k] = float(carry(k, u - known));
    }
    return weights;
}

} // namespace semrover
