// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/model.h"

#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

bool has_voxfield(const Path& path)
{
    return is_there(path / "voxfield_transformer") || is_there(path / "config.json");
}

bool has_renderer(const Path& path)
{
    return is_file(path) || is_there(path / "renderer") || is_there(path / "unet");
}

} // namespace

Result<std::shared_ptr<Model>> Model::load(Device& device, ModelRequest request, const Progress& progress)
{
    std::shared_ptr<Model> model(new Model(std::move(request)));
    SR_CHECK(model->open(device));
    SR_CHECK(model->upload(device, progress));
    return model;
}

// configs, and what the weights will take
Status Model::open(Device& device)
{
    const Path& path = request_.path;
    const bool all = !request_.if_there;
    if (!all && !has_voxfield(path) && !has_renderer(path))
        return fail(ErrorCode::bad_input,
                    "'{}' has no voxfield_transformer/config.json and no renderer: a model is a folder in the "
                    "diffusers layout",
                    path.string());
    if (request_.voxfield && (all || has_voxfield(path))) {
        SR_TRY(voxfield_, VoxfieldModel::open(path, request_.preset));
        bytes_ += TransformerWeights(voxfield_->config, precision()).device_bytes(device.limits());
    }
    if (request_.renderer && (all || has_renderer(path))) {
        SR_TRY(RendererModel renderer, RendererModel::open(path));
        renderer_bytes_ = Unet::plan(renderer.unet, precision())->device_bytes(device.limits()) +
                          Vae::plan(renderer.vae, precision())->device_bytes(device.limits());
        bytes_ += renderer_bytes_;
        renderer_ = std::make_shared<LoadedNetworks>(device, std::move(renderer), precision());
    }
    return {};
}

Status Model::upload(Device& device, const Progress& progress)
{
    uint64_t done = 0;
    const auto say = [&](uint64_t now) -> Status {
        done = std::min(now, bytes_); // alignment between tensors is known in the sum only
        if (progress && !progress(done, bytes_))
            return fail(ErrorCode::interrupted, "{}: loading was cancelled at {} of {} bytes",
                        quote_path(request_.path), done, bytes_);
        return {};
    };
    const LoadProgress added = [&](uint64_t bytes) { return say(done + bytes); };
    SR_CHECK(say(0));
    if (voxfield_) {
        SR_TRY(transformer_, Transformer::load(device, voxfield_->transformer, precision(), voxfield_->adapter, added));
    }
    // without room for both they are loaded in turn, by who renders
    if (renderer_ && (!device.budget() || device.allocated_bytes() + renderer_bytes_ <= device.budget()))
        SR_CHECK(renderer_->keep(added));
    SR_CHECK(say(bytes_));
    if (transformer_) // frequencies beside the weights
        bytes_ += transformer_->device_bytes(device.limits()) - transformer_->weights().device_bytes(device.limits());
    return {};
}

} // namespace semrover
