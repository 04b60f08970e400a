// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/sampling/schedule.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace semrover {

namespace {

// numpy.linspace(0, last, count)
std::vector<double> linspace(double last, int count)
{
    std::vector<double> values(count, 0.0);
    for (int i = 1; i < count; ++i)
        values[i] = i * (last / (count - 1));
    if (count > 1)
        values.back() = last;
    return values;
}

// numpy.arange(train, 0, -train / steps).round() - 1: numpy multiplies by the difference of the first two values
std::vector<double> trailing(int train, int steps)
{
    const double delta = (train - double(train) / steps) - train;
    std::vector<double> values(steps);
    for (int i = 0; i < steps; ++i)
        values[i] = std::nearbyint(train + i * delta) - 1;
    return values;
}

// train (i / steps)^2 - 1, i falling from steps to 1, and no two alike: most steps where little noise is left. The
// quadratic spacing of arXiv 2010.02502, appendix D.2, begun at the last timestep, as trailing is.
std::vector<double> quadratic(int train, int steps)
{
    std::vector<double> values(steps);
    for (int i = 0; i < steps; ++i) {
        const double part = double(steps - i) / steps;
        values[i] = std::max(std::nearbyint(train * part * part) - 1, double(steps - 1 - i));
    }
    return values;
}

// timesteps in the order they are visited; fractions only with linspace and euler
Result<std::vector<double>> spaced_timesteps(const SchedulerConfig& config, int steps)
{
    const int train = config.num_train_timesteps;
    const int dropped = config.sampler == Sampler::dpmpp_2m ? 1 : 0; // it spaces one more and drops the last
    std::vector<double> values;
    if (config.spacing == TimestepSpacing::trailing) {
        values = trailing(train, steps);
    } else if (config.spacing == TimestepSpacing::quadratic) {
        values = quadratic(train, steps);
    } else {
        values = config.spacing == TimestepSpacing::linspace ? linspace(train - 1, steps + dropped)
                                                             : std::vector<double>(steps + dropped);
        for (int i = 0; i < steps + dropped; ++i)
            if (config.spacing == TimestepSpacing::leading)
                values[i] = double(i) * (train / (steps + dropped)) + config.steps_offset;
            else if (config.sampler != Sampler::euler)
                values[i] = std::nearbyint(values[i]); // halves to even, as numpy
        std::reverse(values.begin(), values.end());
        values.resize(steps);
    }
    if (values.front() > train - 1)
        return fail(ErrorCode::bad_input, "{} steps with steps_offset {} start at timestep {}, past the last one, {}",
                    steps, config.steps_offset, values.front(), train - 1);
    return values;
}

// x0 = x0_x * x + x0_m * m, for x = alpha * x0 + sigma * noise
void set_prediction(StepCoefficients& step, Prediction prediction, double alpha, double sigma)
{
    switch (prediction) {
    case Prediction::sample:
        step.x0_m = 1;
        break;
    case Prediction::epsilon:
        step.x0_x = 1 / alpha;
        step.x0_m = -sigma / alpha;
        break;
    case Prediction::v_prediction: // alpha^2 + sigma^2 = 1
        step.x0_x = alpha;
        step.x0_m = -sigma;
        break;
    }
}

void set_known(StepCoefficients& step, double next_abar, bool last)
{
    step.known_scale = last ? 1 : std::sqrt(next_abar);
    step.known_noise = last ? 0 : std::sqrt(1 - next_abar);
}

// how far x0 is off at a timestep, between the rows of the table and constant beyond them
PredictionError prediction_error(const std::vector<PredictionError>& table, double timestep)
{
    const auto above = std::ranges::upper_bound(table, timestep, {}, &PredictionError::timestep);
    if (above == table.begin())
        return table.front();
    if (above == table.end())
        return table.back();
    const PredictionError &low = above[-1], &high = above[0];
    const double share = (timestep - low.timestep) / (high.timestep - low.timestep);
    return {timestep, std::lerp(low.places, high.places, share), std::lerp(low.colors, high.colors, share)};
}

// The fresh noise of a step has to make up for what x0, a mean, leaves out: the variance about it, theorem 1 of
// Analytic-DPM (arXiv 2201.06503), with measured errors.
void set_analytic_noise(const SchedulerConfig& config, double small, StepCoefficients& step)
{
    const PredictionError error = prediction_error(config.prediction_errors, step.timestep);
    const double share = step.c_x0 * step.c_x0;
    step.c_z = std::sqrt(small + share * error.places);
    step.c_z_color = std::sqrt(small + share * error.colors);
}

// posterior mean and variance, formula (7) of arXiv 2006.11239, for steps of any length
StepCoefficients ddpm_step(const SchedulerConfig& config, double timestep, double abar, double next, bool last)
{
    StepCoefficients step;
    step.timestep = timestep;
    step.abar = abar;
    set_prediction(step, config.prediction, std::sqrt(abar), std::sqrt(1 - abar));
    const double beta = 1 - abar / next;
    step.c_x0 = std::sqrt(next) * beta / (1 - abar);
    step.c_x = std::sqrt(abar / next) * (1 - next) / (1 - abar);
    const double small = std::max((1 - next) / (1 - abar) * beta, 1e-20);
    if (!last && config.variance_type == VarianceType::analytic)
        set_analytic_noise(config, small, step);
    else if (!last)
        step.c_z = std::sqrt(config.variance_type == VarianceType::fixed_small ? small : beta);
    set_known(step, next, last);
    return step;
}

// formula (12) of arXiv 2010.02502: x' = sqrt(next) * x0 + sqrt(1 - next - fresh^2) * noise + fresh * z, where fresh is
// eta times the deviation of DDPM's step, formula (16)
// note: the noise comes from the prediction before it is clipped
StepCoefficients ddim_step(const SchedulerConfig& config, double timestep, double abar, double next, bool last)
{
    StepCoefficients step;
    step.timestep = timestep;
    step.abar = abar;
    const double alpha = std::sqrt(abar), sigma = std::sqrt(1 - abar);
    const double fresh = config.eta * config.eta * (1 - next) / (1 - abar) * (1 - abar / next);
    const double direction = std::sqrt(1 - next - fresh);
    set_prediction(step, config.prediction, alpha, sigma);
    step.c_z = last ? 0 : std::sqrt(fresh);
    step.c_x0 = std::sqrt(next);
    switch (config.prediction) {
    case Prediction::epsilon:
        step.c_m = direction;
        break;
    case Prediction::sample: // noise = (x - alpha * m) / sigma
        step.c_x = direction / sigma;
        step.c_m = -direction * alpha / sigma;
        break;
    case Prediction::v_prediction: // noise = alpha * m + sigma * x
        step.c_x = direction * sigma;
        step.c_m = direction * alpha;
        break;
    }
    set_known(step, next, last);
    return step;
}

void fill_markov(const SchedulerConfig& config, const std::vector<double>& timesteps, Schedule& schedule)
{
    const auto abar = alphas_cumprod(config);
    const int stride = config.num_train_timesteps / int(timesteps.size());
    for (size_t i = 0; i < timesteps.size(); ++i) {
        const bool last = i + 1 == timesteps.size();
        const double now = abar[size_t(timesteps[i])];
        if (config.sampler == Sampler::ddpm) {
            const double next = last ? 1.0 : abar[size_t(timesteps[i + 1])];
            schedule.steps.push_back(ddpm_step(config, timesteps[i], now, next, last));
        } else {
            // note: diffusers' DDIM goes down by a fixed stride, which trailing and linspace only meet on average
            const bool even = config.spacing != TimestepSpacing::quadratic;
            const double next = even ? timesteps[i] - stride : last ? -1 : timesteps[i + 1];
            const double end = config.set_alpha_to_one ? 1.0 : abar[0];
            schedule.steps.push_back(ddim_step(config, timesteps[i], now, next >= 0 ? abar[size_t(next)] : end, last));
        }
    }
    schedule.restarts = schedule.steps;
}

// sigma = sqrt((1 - abar) / abar): the noise per unit of signal
std::vector<double> all_sigmas(const SchedulerConfig& config)
{
    auto sigmas = alphas_cumprod(config);
    for (double& value : sigmas)
        value = std::sqrt((1 - value) / value);
    return sigmas;
}

double interpolate(const std::vector<double>& table, double position)
{
    const size_t low = std::min(size_t(position), table.size() - 1), high = std::min(low + 1, table.size() - 1);
    return table[low] + (position - double(low)) * (table[high] - table[low]);
}

// the timestep at which the schedule has this sigma, linear in log sigma
double timestep_of(double sigma, const std::vector<double>& sigmas)
{
    if (sigmas.size() < 2)
        return 0;
    const auto above = std::upper_bound(sigmas.begin(), sigmas.end(), sigma);
    const auto low = std::min<size_t>(size_t(std::max<ptrdiff_t>(above - sigmas.begin() - 1, 0)), sigmas.size() - 2);
    const double from = std::log(sigmas[low]), to = std::log(sigmas[low + 1]);
    return double(low) + std::clamp((std::log(sigma) - from) / (to - from), 0.0, 1.0);
}

struct SigmaStep {
    double timestep, sigma;
};

// timesteps and sigmas of the samplers that think in sigmas, with the final sigma last
std::vector<SigmaStep> sigma_steps(const SchedulerConfig& config, const std::vector<double>& timesteps)
{
    const auto sigmas = all_sigmas(config);
    std::vector<SigmaStep> steps;
    for (double timestep : timesteps)
        steps.push_back({timestep, interpolate(sigmas, timestep)});
    if (config.use_karras_sigmas) {
        // arXiv 2206.00364, formula (5)
        constexpr double kRho = 7;
        const bool euler = config.sampler == Sampler::euler;
        const double high = std::pow(config.sigma_max.value_or(euler ? steps.front().sigma : sigmas.back()), 1 / kRho);
        const double low = std::pow(config.sigma_min.value_or(euler ? steps.back().sigma : sigmas.front()), 1 / kRho);
        const auto ramp = linspace(1, int(steps.size()));
        for (size_t i = 0; i < steps.size(); ++i) {
            steps[i].sigma = std::pow(high + ramp[i] * (low - high), kRho);
            steps[i].timestep = timestep_of(steps[i].sigma, sigmas);
            if (!euler && config.beta_schedule != BetaSchedule::squaredcos_cap_v2)
                steps[i].timestep = std::nearbyint(steps[i].timestep);
        }
    }
    if (config.continuous_timesteps)
        for (SigmaStep& step : steps)
            step.timestep = 0.25 * std::log(step.sigma);
    steps.push_back({0, config.final_sigma_zero ? 0 : sigmas.front()});
    return steps;
}

// DPM-Solver++ 2M, arXiv 2211.01095 algorithm 2, midpoint; before: the sigma x0_prev was predicted at, 0 for none.
//     alpha = 1 / sqrt(sigma^2 + 1), h = ln(sigma / next), h0 = ln(before / sigma)
//     x' = alpha' * next / (alpha * sigma) * x + alpha' * (1 - next / sigma) * (x0 + h / (2 h0) * (x0 - x0_prev))
StepCoefficients dpmpp_step(const SchedulerConfig& config, const SigmaStep& now, double next, double before, bool last)
{
    StepCoefficients step;
    step.timestep = now.timestep;
    step.abar = 1 / (now.sigma * now.sigma + 1);
    const double alpha = std::sqrt(step.abar), next_alpha = 1 / std::sqrt(next * next + 1);
    set_prediction(step, config.prediction, alpha, now.sigma * alpha);
    step.c_x = next_alpha * next / (alpha * now.sigma);
    step.c_x0 = next_alpha * (1 - next / now.sigma);
    // note: timesteps repeat when there are nearly as many steps as training steps; there is no slope between equals
    if (before > now.sigma && next > 0) {
        const double slope = std::log(now.sigma / next) / (2 * std::log(before / now.sigma));
        step.c_prev = -step.c_x0 * slope;
        step.c_x0 += step.c_x0 * slope;
    }
    set_known(step, next_alpha * next_alpha, last);
    return step;
}

void fill_dpmpp(const SchedulerConfig& config, const std::vector<double>& timesteps, Schedule& schedule)
{
    const auto sigmas = sigma_steps(config, timesteps);
    const size_t count = timesteps.size();
    const bool first_order_last =
        config.euler_at_final || (config.lower_order_final && count < 15) || config.final_sigma_zero;
    for (size_t i = 0; i < count; ++i) {
        const bool last = i + 1 == count;
        const bool first_order = i == 0 || config.solver_order == 1 || (last && first_order_last);
        const double before = first_order ? 0 : sigmas[i - 1].sigma;
        schedule.steps.push_back(dpmpp_step(config, sigmas[i], sigmas[i + 1].sigma, before, last));
        schedule.restarts.push_back(dpmpp_step(config, sigmas[i], sigmas[i + 1].sigma, 0, last));
    }
}

// x' = x + (x - x0) / sigma * (next - sigma), for x = x0 + sigma * noise
void fill_euler(const SchedulerConfig& config, const std::vector<double>& timesteps, Schedule& schedule)
{
    const auto sigmas = sigma_steps(config, timesteps);
    for (size_t i = 0; i < timesteps.size(); ++i) {
        const double sigma = sigmas[i].sigma;
        StepCoefficients step;
        step.timestep = sigmas[i].timestep;
        step.in_scale = 1 / std::sqrt(sigma * sigma + 1);
        step.abar = 1 / (sigma * sigma + 1);
        // the prediction formulas hold for in_scale * x, whose alpha is in_scale
        set_prediction(step, config.prediction, step.in_scale, sigma * step.in_scale);
        step.x0_x *= step.in_scale;
        step.c_x = sigmas[i + 1].sigma / sigma;
        step.c_x0 = 1 - step.c_x;
        step.known_noise = sigmas[i + 1].sigma; // and known_scale 1
        schedule.steps.push_back(step);
    }
    schedule.restarts = schedule.steps;
    double top = 0;
    for (const SigmaStep& step : sigmas)
        top = std::max(top, step.sigma);
    schedule.init_noise_sigma = config.spacing == TimestepSpacing::leading ? std::sqrt(top * top + 1) : top;
}

} // namespace

std::vector<double> alphas_cumprod(const SchedulerConfig& config)
{
    const int train = config.num_train_timesteps;
    const bool scaled = config.beta_schedule == BetaSchedule::scaled_linear;
    const double start = scaled ? std::sqrt(config.beta_start) : config.beta_start;
    const double end = scaled ? std::sqrt(config.beta_end) : config.beta_end;
    // abar(t) of arXiv 2102.09672, formula (17)
    const auto cosine = [&](int i) {
        const double c = std::cos((double(i) / train + 0.008) / 1.008 * std::numbers::pi / 2);
        return c * c;
    };
    std::vector<double> abar(train);
    double product = 1;
    for (int i = 0; i < train; ++i) {
        double beta = train > 1 ? start + (end - start) * i / (train - 1) : start;
        if (scaled)
            beta *= beta;
        if (config.beta_schedule == BetaSchedule::squaredcos_cap_v2)
            beta = std::min(1 - cosine(i + 1) / cosine(i), 0.999);
        product *= 1 - beta;
        abar[i] = product;
    }
    return abar;
}

Result<Schedule> make_schedule(const SchedulerConfig& config, int steps)
{
    const int limit = std::min(kMaxInferenceSteps, config.num_train_timesteps);
    if (steps < 1 || steps > limit)
        return fail(ErrorCode::bad_input, "{} denoising steps, expected 1 to {}", steps, limit);
    SR_TRY(const std::vector<double> timesteps, spaced_timesteps(config, steps));
    Schedule schedule;
    schedule.sampler = config.sampler;
    if (config.clip_sample)
        schedule.clip = config.clip_sample_range;
    if (config.sampler == Sampler::dpmpp_2m)
        fill_dpmpp(config, timesteps, schedule);
    else if (config.sampler == Sampler::euler)
        fill_euler(config, timesteps, schedule);
    else
        fill_markov(config, timesteps, schedule);
    if (config.sampler != Sampler::euler)
        schedule.init_known_scale = std::sqrt(schedule.steps.front().abar);
    return schedule;
}

} // namespace semrover
