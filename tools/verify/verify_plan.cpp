// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// golden kinds scheduler, repaint_timesteps and region_extraction
#include "engine/sampling/repaint.h"
#include "engine/voxfield/regions.h"
#include "kernels/sampling.h"
#include "runtime/device/executable.h"
#include "runtime/device/tensor_pool.h"
#include "shaders/lib/step_row.h"
#include "tools/verify/golden_case.h"

namespace semrover {

namespace {

// runs the step kernel on given model outputs; state [elements] as one row
class StepRunner {
  public:
    static Result<std::unique_ptr<StepRunner>> create(Device& device, const Schedule& schedule, uint32_t elements)
    {
        auto r = std::unique_ptr<StepRunner>(new StepRunner(device));
        constexpr uint32_t kWords = sizeof(StepRow) / 4;
        r->steps_ = r->state_.tensor(uint32_t(schedule.steps.size()), kWords, DType::u32, "steps", kWords);
        r->clock_ = r->state_.tensor(1, 2, DType::u32, "clock", 2);
        for (DeviceTensor* slot : {&r->m_, &r->z_, &r->fixed_, &r->x_, &r->x0_})
            *slot = r->state_.tensor(1, elements, DType::f32, "row");
        r->known_ = r->state_.tensor(1, 1, DType::u32, "known", 1);
        SR_CHECK(r->state_.allocate(device, "golden case"));
        std::vector<StepRow> rows;
        for (const StepCoefficients& c : schedule.steps)
            rows.push_back(step_row({.coefficients = c}));
        SR_CHECK(r->steps_.write(device, rows));
        for (const DeviceTensor& slot : {r->clock_, r->known_, r->fixed_, r->x0_, r->z_})
            SR_CHECK(slot.clear(device));
        SR_TRY(r->executable_, r->build(float(schedule.clip)));
        return r;
    }
    Status set_state(std::span<const float> x) { return x_.write_rows(device_, x); }
    Result<std::vector<float>> step(std::span<const float> m, std::span<const float> z)
    {
        SR_CHECK(m_.write_rows(device_, m));
        if (!z.empty())
            SR_CHECK(z_.write_rows(device_, z));
        SR_CHECK(executable_->run());
        return x_.read_rows(device_, 1);
    }

  private:
    explicit StepRunner(Device& device) : device_(device) {}
    Result<std::unique_ptr<Executable>> build(float clip)
    {
        Graph g(device_.limits());
        const StepTable table{steps_.in(g), clock_.in(g)};
        step_update(g, table, m_.in(g), z_.in(g), known_.in(g), fixed_.in(g), x_.in(g), x0_.in(g), 1, clip);
        step_advance(g, table.clock);
        return Executable::create(device_, g);
    }

    Device& device_;
    TensorPool state_;
    DeviceTensor steps_, clock_, m_, z_, fixed_, x_, x0_, known_;
    std::unique_ptr<Executable> executable_;
};

} // namespace

Result<GoldenOutputs> run_scheduler(Device& device, const GoldenCase& c, DType)
{
    nlohmann::json json = c.params();
    json["_class_name"] = json.value("type", "");
    json.erase("type");
    json.erase("num_inference_steps");
    std::vector<std::string> warnings;
    SR_TRY(const SchedulerConfig config, scheduler_config_from_json(json, warnings));
    SR_TRY(const double steps, c.number("num_inference_steps"));
    SR_TRY(const Schedule schedule, make_schedule(config, int(steps)));
    const auto outputs = c.floats("input.model_outputs"), noise = c.floats("input.noise");
    std::vector<float> x = c.floats("input.sample");
    const size_t n = x.size();
    if (n == 0 || outputs.size() != schedule.steps.size() * n || (!noise.empty() && noise.size() != outputs.size()))
        return fail(ErrorCode::bad_input, "{}: {} outputs of {} elements for {} steps", c.name(), outputs.size(), n,
                    schedule.steps.size());
    SR_TRY(const auto runner, StepRunner::create(device, schedule, uint32_t(n)));
    SR_CHECK(runner->set_state(x));
    GoldenOutputs out;
    auto& states = out.floats["states"];
    states = x;
    for (size_t i = 0; i < schedule.steps.size(); ++i) {
        const std::span<const float> z = noise.empty() ? std::span<const float>() : std::span(noise).subspan(i * n, n);
        SR_TRY(x, runner->step(std::span(outputs).subspan(i * n, n), z));
        states.insert(states.end(), x.begin(), x.end());
        out.floats["timesteps"].push_back(float(schedule.steps[i].timestep));
    }
    return out;
}

Result<GoldenOutputs> run_repaint_timesteps(Device&, const GoldenCase& c, DType)
{
    SR_TRY(const double steps, c.number("steps"));
    SR_TRY(const double length, c.number("jump_length"));
    SR_TRY(const double samples, c.number("jump_n_sample"));
    SR_TRY(const double train, c.number("num_train_timesteps"));
    SR_TRY(const std::vector<int> levels, repaint_levels(int(steps), {int(length), int(samples)}));
    GoldenOutputs out;
    for (int level : levels)
        out.integers["timesteps"].push_back(int64_t(level) * (int64_t(train) / int64_t(steps)));
    return out;
}

Result<GoldenOutputs> run_region_extraction(Device&, const GoldenCase& c, DType)
{
    RegionOptions options;
    SR_TRY(const double size, c.number("region_size"));
    SR_TRY(const double threshold, c.number("coverage_threshold"));
    SR_TRY(const double seed, c.number("first_seed"));
    options.region_size = int(size);
    options.coverage_threshold = int(threshold);
    options.first_cell = int64_t(seed);
    options.strategy = c.params().value("strategy", "") == "paper" ? RegionStrategy::paper : RegionStrategy::complete;
    const auto flat = c.integers("input.cells");
    std::vector<std::array<int32_t, 3>> cells(flat.size() / 3);
    for (size_t i = 0; i < flat.size(); ++i)
        cells[i / 3][i % 3] = int32_t(flat[i]);
    SR_TRY(const Regions regions, extract_regions(cells, options));
    GoldenOutputs out;
    out.integers["offsets"].assign(regions.offsets.begin(), regions.offsets.end());
    out.integers["members"].assign(regions.members.begin(), regions.members.end());
    out.integers["uncovered"].assign(regions.uncovered.begin(), regions.uncovered.end());
    return out;
}

} // namespace semrover
