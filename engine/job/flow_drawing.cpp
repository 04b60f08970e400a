// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/flow_drawing.h"

#include "kernels/picture.h"

namespace semrover {

namespace {

RasterizerOptions surface_options(RasterizerOptions options)
{
    constexpr PictureFormat none{Texels::none};
    options.pixels_over.reset();
    options.formats = {none, none, {}, none, {}};
    return options;
}

std::pair<double, Rigid> place_of(const CameraFrame& frame)
{
    return {frame.time, frame.pose.world_to_camera};
}

} // namespace

FlowDrawing::FlowDrawing(Device& device, const SplatScene& scene, const SceneActors& actors,
                         const RasterizerOptions& options)
    : device_(device), scene_(scene), actors_(actors), options_(surface_options(options))
{
}

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

Result<std::unique_ptr<Program>> FlowDrawing::make_program(const Camera& c, const View& from, const View& to,
                                                           const Intrinsics& i)
{
    Graph g;
    const FlowOptions options{.width = i.width, .height = i.height, .lens = lens_of(i.model)};
    const FlowTensors y = splat_flow(g, c.lenses.in(g), {c.moves.in(g), c.rows.valid() ? c.rows.in(g) : Tensor{}},
                                     {from.depth.in(g), from.owners.in(g)}, to.depth.in(g), options);
    g.keep(y.flow, c.flow);
    g.keep(y.states, c.flow_states);
    return Program::create(device_, g);
}

Status FlowDrawing::make(Camera& c, const Intrinsics& i)
{
    if (!copies_) {
        SR_TRY(copies_, CopyRing::create(device_));
    }
    const uint32_t pixels = i.width * i.height;
    c = Camera();
    c.model = i.model;
    for (View* view : {&c.now, &c.next}) {
        view->depth = c.state.slot(pixels, 2, DType::f32, "depth of a frame", 2);
        view->owners = c.state.slot(pixels, 1, DType::u32, "owners of a frame", 1);
    }
    c.lenses = c.state.slot(2, kLensCameraFloats, DType::f32, "lenses", kLensCameraFloats);
    c.moves = c.state.slot(1 + actors_.size(), 12, DType::f32, "moves", 12);
    if (actors_.size())
        c.rows = c.state.slot(uint32_t(actors_.rows().size()), 1, DType::u32, "rows of movers", 1);
    c.flow = c.state.slot(pixels, 2, DType::f32, "flow", 2);
    c.flow_states = c.state.slot(pixels, 1, DType::u32, "flow states", 1);
    SR_CHECK(c.state.allocate(device_, "flow"));
    if (actors_.size())
        SR_CHECK(c.rows.write(device_, actors_.rows()));
    RasterizerOptions options = options_;
    options.model = i.model;
    SR_TRY(c.rasterizer, Rasterizer::create(device_, scene_, i.width, i.height, 1, options));
    SR_TRY(c.forward, make_program(c, c.now, c.next, i));
    SR_TRY(c.backward, make_program(c, c.next, c.now, i));
    return {};
}

Status FlowDrawing::draw(Camera& c, const CameraFrame& frame, View& view)
{
    if (view.of == place_of(frame))
        return {};
    view.of.reset();
    const SplatCamera camera = splat_camera(frame.intrinsics, frame.pose);
    SR_CHECK(c.rasterizer->draw({&camera, 1}, actors_.seen_by({&frame, 1})).map([](uint32_t) {}));
    const SplatSlots images = c.rasterizer->images(0);
    SR_CHECK(copies_->copy(images.depth, view.depth).map([](uint64_t) {}));
    SR_CHECK(copies_->copy(images.owners, view.owners).map([](uint64_t) {}));
    view.of = place_of(frame);
    return {};
}

Result<FlowSlots> FlowDrawing::flow(const CameraFrame& now, const CameraFrame& next)
{
    Camera& c = cameras_[now.camera];
    const Intrinsics& i = now.intrinsics;
    const uint32_t pixels = i.width * i.height;
    if (!c.backward || c.flow.rows() != pixels || c.model != i.model)
        SR_CHECK(make(c, i));
    const bool turned = c.next.of == place_of(now); // it was the next one the last time
    View &from = turned ? c.next : c.now, &to = turned ? c.now : c.next;
    SR_CHECK(draw(c, now, from));
    SR_CHECK(draw(c, next, to));
    std::vector<float> lenses(2 * kLensCameraFloats);
    write_row(splat_camera(i, Pose()), std::span(lenses).first(kLensCameraFloats));
    write_row(splat_camera(next.intrinsics, Pose()), std::span(lenses).last(kLensCameraFloats));
    SR_CHECK(c.lenses.write(device_, lenses));
    SR_CHECK(c.moves.write(device_, actors_.moves(now, next)));
    SR_CHECK((turned ? c.backward : c.forward)->run());
    return FlowSlots{c.flow, c.flow_states};
}

} // namespace semrover
