// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/flow_drawing.h"

#include "kernels/picture.h"

namespace semrover {

namespace {

std::pair<double, Rigid> place_of(const CameraFrame& frame)
{
    return {frame.time, frame.pose.world_to_camera};
}

} // namespace

std::vector<size_t> following_frames(const CameraPath& path)
{
    const auto kind = [&](size_t i) {
        const Intrinsics& k = path.frames[i].intrinsics;
        return std::tuple(k.model, k.width, k.height);
    };
    std::vector<size_t> following(path.frames.size(), path.frames.size());
    std::map<std::string, size_t> last;
    for (size_t i = 0; i < path.frames.size(); ++i) {
        const auto [before, first] = last.try_emplace(path.frames[i].camera, i);
        if (!first && kind(before->second) == kind(i))
            following[before->second] = i;
        before->second = i;
    }
    return following;
}

RasterizerOptions FlowDrawing::surface_options(RasterizerOptions options)
{
    constexpr PictureFormat none{Texels::none};
    options.pixels_over.reset();
    options.formats = {none, none, {}, none, {}};
    return options;
}

FlowDrawing::FlowDrawing(Device& device, const SceneActors& actors, Draw draw)
    : device_(device), actors_(actors), draw_(std::move(draw))
{
}

void FlowDrawing::forget()
{
    for (auto& [name, camera] : cameras_)
        for (View& view : camera.views)
            view.of.reset();
}

Status FlowDrawing::allocate(Camera& c, uint32_t pixels)
{
    c = Camera();
    for (View& view : c.views) {
        view.depth = c.state.tensor(pixels, 2, DType::f32, "depth of a frame", 2);
        view.owners = c.state.tensor(pixels, 1, DType::u32, "owners of a frame", 1);
    }
    c.cameras = c.state.tensor(2, kLensCameraFloats, DType::f32, "cameras", kLensCameraFloats);
    c.moves = c.state.tensor(1 + actors_.size(), 12, DType::f32, "moves", 12);
    if (actors_.size())
        c.rows = c.state.tensor(uint32_t(actors_.rows().size()), 1, DType::u32, "rows of movers", 1);
    c.flow = c.state.tensor(pixels, 2, DType::f32, "flow", 2);
    c.flow_states = c.state.tensor(pixels, 1, DType::u32, "flow states", 1);
    return c.state.allocate(device_, "flow");
}

Status FlowDrawing::compile(Camera& c, const CameraPair& pair, const ImageSize& size)
{
    c.model = pair.model;
    c.moving = pair.moving;
    const FlowOptions options{
        .width = size.width, .height = size.height, .lens = lens_of(pair.model), .moving = pair.moving};
    for (size_t from = 0; from < 2; ++from) {
        const View &now = c.views[from], &next = c.views[1 - from];
        Graph g(device_.limits());
        const FlowMoves moves{c.moves.in(g), c.rows.valid() ? c.rows.in(g) : Tensor{}};
        const FlowTensors y =
            splat_flow(g, c.cameras.in(g), moves, {now.depth.in(g), now.owners.in(g)}, next.depth.in(g), options);
        g.keep(y.flow, c.flow);
        g.keep(y.states, c.flow_states);
        SR_TRY(c.executables[from], Executable::create(device_, g));
    }
    return {};
}

Status FlowDrawing::draw(const CameraFrame& frame, View& view)
{
    if (view.of == place_of(frame))
        return {};
    view.of.reset();
    if (!copies_) {
        SR_TRY(copies_, CopyRing::create(device_));
    }
    SR_TRY(const SplatSlots images, draw_(frame));
    SR_CHECK(copies_->copy(images.depth, view.depth).map([](uint64_t) {}));
    SR_CHECK(copies_->copy(images.owners, view.owners).map([](uint64_t) {}));
    view.of = place_of(frame);
    return {};
}

Result<FlowSlots> FlowDrawing::flow(const CameraFrame& now, const CameraFrame& next)
{
    Camera& c = cameras_[now.camera];
    const ImageSize size{now.intrinsics.width, now.intrinsics.height};
    if (!c.flow.valid() || c.flow.rows() != size.width * size.height || c.moves.rows() != 1 + actors_.size() ||
        c.rows.rows() != actors_.rows().size())
        SR_CHECK(allocate(c, size.width * size.height));
    const CameraPair pair = pair_of(now, next);
    if (!c.executables[1] || c.model != pair.model || c.moving != pair.moving)
        SR_CHECK(compile(c, pair, size));
    const size_t from = c.views[1].of == place_of(now); // it was the next one the last time
    SR_CHECK(draw(now, c.views[from]));
    SR_CHECK(draw(next, c.views[1 - from]));
    SR_CHECK(c.cameras.write(device_, pair.rows));
    SR_CHECK(c.moves.write(device_, actors_.moves(now, next)));
    if (c.rows.valid())
        SR_CHECK(c.rows.write(device_, actors_.rows()));
    SR_CHECK(c.executables[from]->run());
    return FlowSlots{c.flow, c.flow_states};
}

} // namespace semrover
