// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/pointnet.h"

#include "runtime/device/executable.h"
#include "runtime/device/tensor_pool.h"

#include <cmath>

namespace semrover {

struct PointFeatures::Impl {
    Device& device;
    const Pointnet& network;
    uint32_t batch;
    TensorPool state;
    DeviceTensor positions, inputs, features;
    std::unique_ptr<Executable> executable;

    Impl(Device& d, const Pointnet& n, uint32_t b) : device(d), network(n), batch(b)
    {
        const PointnetConfig& c = network.config();
        positions = state.tensor(batch * c.points, 4, DType::f32, "points", 4);
        inputs = state.tensor(batch * c.points, c.input_width(), DType::f32, "inputs");
        features = state.tensor(round_up(batch, kImageRowPadding), network.features(), DType::f32, "features");
    }
    Graph graph() const
    {
        Graph g(device.limits());
        g.keep(network.forward(g, positions.in(g), inputs.in(g), batch), features);
        return g;
    }
    Result<uint64_t> planned_bytes() const
    {
        SR_TRY(const Plan plan, make_plan(graph()));
        return state.planned_bytes(device.limits()) + plan.arena_bytes();
    }
    Status allocate()
    {
        SR_CHECK(state.allocate(device, "points and features"));
        SR_TRY(executable, Executable::create(device, graph()));
        return {};
    }
};

PointFeatures::PointFeatures(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
PointFeatures::~PointFeatures() = default;

Result<std::unique_ptr<PointFeatures>> PointFeatures::create(Device& device, const Pointnet& network, uint32_t batch)
{
    for (;; batch = (batch + 1) / 2) {
        auto impl = std::make_unique<Impl>(device, network, batch);
        const auto bytes = impl->planned_bytes();
        const bool fits = bytes && (!device.budget() || device.allocated_bytes() + *bytes <= device.budget());
        if (!fits && batch > 1)
            continue;
        SR_CHECK(impl->allocate());
        return std::unique_ptr<PointFeatures>(new PointFeatures(std::move(impl)));
    }
}

uint32_t PointFeatures::batch() const
{
    return impl_->batch;
}

Status PointFeatures::append(const PointChunks& chunks, uint32_t first, uint32_t count, Features& features)
{
    Impl& m = *impl_;
    const uint32_t points = m.network.config().points, width = m.network.config().input_width();
    SR_ASSERT(count >= 1 && count <= m.batch && first + count <= chunks.count && chunks.points == points &&
                  chunks.width == width,
              "chunks {} to {} of {} for a batch of {}", first, first + count, chunks.count, m.batch);
    std::vector<float> positions(size_t(m.batch) * points * 4), inputs(size_t(m.batch) * points * width);
    for (size_t i = 0; i < size_t(m.batch) * points; ++i) { // a batch that is not full repeats its last chunk
        const size_t from = (first + std::min<size_t>(i / points, count - 1)) * points + i % points;
        std::copy_n(&chunks.positions[from * 4], 4, &positions[i * 4]);
        std::copy_n(&chunks.inputs[from * width], width, &inputs[i * width]);
    }
    SR_CHECK(m.positions.write(m.device, positions));
    SR_CHECK(m.inputs.write_rows(m.device, inputs));
    SR_CHECK(m.executable->run());
    SR_TRY(const std::vector<float> rows, m.features.read_rows(m.device, count));
    features.cols = m.network.features();
    for (uint32_t i = 0; i < count; ++i) {
        const float* row = &rows[size_t(i) * features.cols];
        for (uint32_t n = 0; n < features.cols; ++n)
            if (!std::isfinite(row[n]))
                return fail(ErrorCode::internal, "a feature of chunk {} is {}", first + i, row[n]);
        features.values.insert(features.values.end(), row, row + features.cols);
        ++features.rows;
    }
    return {};
}

} // namespace semrover
