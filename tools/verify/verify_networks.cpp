// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// golden kinds unet_2d_condition and autoencoder_kl, and the same of videos
#include "engine/network/unet.h"
#include "engine/network/vae.h"
#include "runtime/base/json.h"
#include "runtime/device/executable.h"
#include "runtime/device/tensor_pool.h"
#include "tools/verify/golden_case.h"

#include <numeric>

namespace semrover {

namespace {

// [images, channels, height, width] of a case
struct Shape {
    uint32_t images, channels, height, width;
};

Result<Shape> shape_of(const GoldenCase& c, const char* name)
{
    const std::vector<uint64_t> s = c.shape(name);
    if (s.size() != 4 || std::any_of(s.begin(), s.end(), [](uint64_t n) { return n == 0 || n > 4096; }))
        return fail(ErrorCode::bad_input, "{}: expected [images, channels, height, width]", name);
    return Shape{uint32_t(s[0]), uint32_t(s[1]), uint32_t(s[2]), uint32_t(s[3])};
}

// NCHW to the rows of a feature map
std::vector<float> to_rows(const std::vector<float>& values, const Shape& s)
{
    const uint32_t pixels = s.height * s.width, rows = round_up(pixels, kImageRowPadding);
    std::vector<float> out(size_t(s.images) * rows * s.channels, 0.f);
    for (uint32_t i = 0; i < s.images; ++i)
        for (uint32_t c = 0; c < s.channels; ++c)
            for (uint32_t p = 0; p < pixels; ++p)
                out[(size_t(i) * rows + p) * s.channels + c] = values[(size_t(i) * s.channels + c) * pixels + p];
    return out;
}

std::vector<float> from_rows(const std::vector<float>& rows, const Shape& s)
{
    const uint32_t pixels = s.height * s.width, image_rows = round_up(pixels, kImageRowPadding);
    std::vector<float> out(size_t(s.images) * s.channels * pixels);
    for (uint32_t i = 0; i < s.images; ++i)
        for (uint32_t c = 0; c < s.channels; ++c)
            for (uint32_t p = 0; p < pixels; ++p)
                out[(size_t(i) * s.channels + c) * pixels + p] = rows[(size_t(i) * image_rows + p) * s.channels + c];
    return out;
}

// runs the graph and reads the fp32 feature map `y` as NCHW
Result<std::vector<float>> run_and_read(Device& device, Graph& g, const FeatureMap& y)
{
    TensorPool state;
    const DeviceTensor out = state.tensor(y.data.rows, y.channels(), DType::f32, "output");
    SR_CHECK(state.allocate(device, "golden case"));
    g.keep(y.data, out);
    SR_TRY(const auto executable, Executable::create(device, g));
    SR_CHECK(executable->run());
    SR_TRY(const std::vector<float> rows, out.read_rows(device, out.rows()));
    return from_rows(rows, {y.batch, y.channels(), y.height, y.width});
}

DeviceTensor input_slot(TensorPool& state, const Shape& s, DType dtype)
{
    return state.tensor(s.images * round_up(s.height * s.width, kImageRowPadding), s.channels, dtype, "input");
}

FeatureMap input_map(Graph& g, const DeviceTensor& slot, const Shape& s)
{
    return {slot.in(g), s.images, s.height, s.width};
}

Result<Json> read_config(const GoldenCase& c)
{
    return read_json(c.model() / "config.json");
}

// one evaluation: every image has a timestep and a text of its own
struct UnetInput {
    Shape shape;
    uint32_t tokens = 0;
    std::vector<float> sample, text; // rows of pixels and of tokens
    std::vector<float> timesteps;
    std::vector<uint32_t> table_row;
};

Result<UnetInput> unet_input(const GoldenCase& c, const UnetConfig& config)
{
    UnetInput in;
    SR_TRY(in.shape, shape_of(c, "input.sample"));
    const uint32_t dim = config.cross_attention_dim;
    const std::vector<uint64_t> text = c.shape("input.encoder_hidden_states");
    if (text.size() != 3 || text[0] != in.shape.images || text[1] > 4096 || text[2] != dim)
        return fail(ErrorCode::bad_input, "input.encoder_hidden_states: expected [{}, tokens, {}]", in.shape.images,
                    dim);
    in.tokens = uint32_t(text[1]);
    in.sample = to_rows(c.floats("input.sample"), in.shape);
    in.text = c.floats("input.encoder_hidden_states");
    for (const int64_t t : c.integers("input.timestep"))
        in.timesteps.push_back(float(t));
    if (in.timesteps.size() != in.shape.images)
        return fail(ErrorCode::bad_input, "input.timestep: expected {} of them", in.shape.images);
    in.table_row.resize(in.shape.images);
    std::iota(in.table_row.begin(), in.table_row.end(), 0u);
    return in;
}

// [videos, frames, channels, height, width] of a case, as images
Result<Shape> video_shape(const GoldenCase& c, const char* name, uint32_t& videos)
{
    const std::vector<uint64_t> s = c.shape(name);
    if (s.size() != 5 || std::any_of(s.begin(), s.end(), [](uint64_t n) { return n == 0 || n > 4096; }) ||
        s[1] > kMostFrames)
        return fail(ErrorCode::bad_input, "{}: expected [videos, up to {} frames, channels, height, width]", name,
                    kMostFrames);
    videos = uint32_t(s[0]);
    return Shape{uint32_t(s[0] * s[1]), uint32_t(s[2]), uint32_t(s[3]), uint32_t(s[4])};
}

// one evaluation of videos, each with a timestep, numbers and a text of its own
struct VideoInput {
    Shape shape;
    uint32_t videos = 0, frames = 0, tokens = 0;
    std::vector<float> sample, text, timesteps, added;
    std::vector<float> numbers;                 // of the frames of a video
    std::vector<uint32_t> video, image, number; // rows of tables: by video, and by image
};

Result<VideoInput> video_input(const GoldenCase& c, const UnetConfig& config)
{
    VideoInput in;
    SR_TRY(in.shape, video_shape(c, "input.sample", in.videos));
    in.frames = in.shape.images / in.videos;
    const std::vector<uint64_t> text = c.shape("input.encoder_hidden_states");
    if (text.size() != 3 || text[0] != in.videos || text[1] > 4096 || text[2] != config.cross_attention_dim)
        return fail(ErrorCode::bad_input, "input.encoder_hidden_states: expected [{}, tokens, {}]", in.videos,
                    config.cross_attention_dim);
    in.tokens = uint32_t(text[1]);
    in.sample = to_rows(c.floats("input.sample"), in.shape);
    in.text = c.floats("input.encoder_hidden_states");
    in.timesteps = c.floats("input.timestep");
    if (in.timesteps.size() == 1)
        in.timesteps.resize(in.videos, in.timesteps[0]);
    in.added = c.floats("input.added_time_ids");
    if (in.timesteps.size() != in.videos || in.added.size() != size_t(in.videos) * config.added_numbers)
        return fail(ErrorCode::bad_input, "input.timestep and added_time_ids: expected 1 and {} for each video",
                    config.added_numbers);
    for (uint32_t i = 0; i < in.shape.images; ++i) {
        in.image.push_back(i / in.frames);
        in.number.push_back(i % in.frames);
    }
    for (uint32_t i = 0; i < in.videos; ++i)
        in.video.push_back(i);
    for (uint32_t i = 0; i < in.frames; ++i)
        in.numbers.push_back(float(i));
    return in;
}

// what a UNet of videos reads, and the tables that are made once
struct VideoSlots {
    TensorPool state;
    DeviceTensor x, text, steps, added, numbers, video, image, number;
    DeviceTensor times, frames, keys;

    VideoSlots(const Unet& unet, const VideoInput& in)
    {
        const UnetConfig& c = unet.config();
        const DType precision = unet.precision();
        x = input_slot(state, in.shape, precision);
        text = state.tensor(in.videos * in.tokens, c.cross_attention_dim, precision, "context");
        steps = state.tensor(in.videos, 1, DType::f32, "timesteps", 1);
        added = state.tensor(in.videos, c.added_numbers, DType::f32, "added", c.added_numbers);
        numbers = state.tensor(in.frames, 1, DType::f32, "frame numbers", 1);
        video = state.tensor(in.videos, 1, DType::u32, "table_row", 1);
        image = state.tensor(in.shape.images, 1, DType::u32, "table_row", 1);
        number = state.tensor(in.shape.images, 1, DType::u32, "frame_row", 1);
        times = state.tensor(in.videos, unet.time_width(), DType::f32, "times");
        frames = state.tensor(in.frames, unet.frame_width(), DType::f32, "frames");
        keys = state.tensor(in.videos * in.tokens, unet.context_width(), precision, "keys and values");
    }
    Status write(Device& device, const VideoInput& in) const
    {
        SR_CHECK(x.write_rows(device, in.sample));
        SR_CHECK(text.write_rows(device, in.text));
        SR_CHECK(steps.write(device, in.timesteps));
        SR_CHECK(added.write(device, in.added));
        SR_CHECK(numbers.write(device, in.numbers));
        SR_CHECK(video.write(device, in.video));
        SR_CHECK(image.write(device, in.image));
        return number.write(device, in.number);
    }
    Graph tables_graph(const DeviceLimits& limits, const Unet& unet) const
    {
        Graph g(limits);
        g.keep(unet.time_table(g, steps.in(g), {}, added.in(g)), times);
        g.keep(unet.frame_table(g, numbers.in(g)), frames);
        g.keep(unet.context_table(g, text.in(g)), keys);
        return g;
    }
};

// mean and log-variance, clamped as the reference does, of what an encoder gave
void add_moments(const std::vector<float>& moments, const Shape& latent, GoldenOutputs& out)
{
    const size_t half = size_t(latent.channels) * latent.height * latent.width;
    for (size_t i = 0; i < latent.images; ++i) {
        const auto* first = &moments[2 * half * i];
        out.floats["mean"].insert(out.floats["mean"].end(), first, first + half);
        for (size_t k = 0; k < half; ++k)
            out.floats["logvar"].push_back(std::clamp(first[half + k], -30.f, 20.f));
    }
}

Result<GoldenOutputs> run_vae(Device& device, const GoldenCase& c, const VaeConfig& config, DType precision)
{
    SR_TRY(const Checkpoint weights, Checkpoint::open_folder(c.model(), Checkpoint::Network::vae));
    SR_TRY(const auto vae, Vae::load(device, config, weights, precision));
    SR_TRY(const Shape image, shape_of(c, "input.image"));
    SR_TRY(const Shape latent, shape_of(c, "input.latent"));
    TensorPool state;
    const DeviceTensor pixels = input_slot(state, image, DType::f32), values = input_slot(state, latent, DType::f32);
    SR_CHECK(state.allocate(device, "golden case"));
    SR_CHECK(pixels.write_rows(device, to_rows(c.floats("input.image"), image)));
    SR_CHECK(values.write_rows(device, to_rows(c.floats("input.latent"), latent)));
    GoldenOutputs out;
    Graph encode(device.limits());
    const FeatureMap in = input_map(encode, pixels, image);
    SR_TRY(const auto moments, run_and_read(device, encode, vae->encode(encode, in)));
    add_moments(moments, latent, out);
    Graph decode(device.limits());
    const FeatureMap z = input_map(decode, values, latent);
    SR_TRY(out.floats["image"], run_and_read(device, decode, vae->decode(decode, z)));
    return out;
}

} // namespace

Result<GoldenOutputs> run_unet_2d_condition(Device& device, const GoldenCase& c, DType precision)
{
    SR_TRY(const Json json, read_config(c));
    SR_TRY(const UnetConfig config, parse_unet_config(json));
    SR_TRY(const Checkpoint weights, Checkpoint::open_folder(c.model(), Checkpoint::Network::unet));
    SR_TRY(const auto unet, Unet::load(device, config, weights, precision));
    SR_TRY(const UnetInput input, unet_input(c, config));
    const uint32_t images = input.shape.images;
    TensorPool state;
    const DeviceTensor x = input_slot(state, input.shape, precision);
    const DeviceTensor text = state.tensor(images * input.tokens, config.cross_attention_dim, precision, "context");
    const DeviceTensor steps = state.tensor(images, 1, DType::f32, "timesteps", 1);
    const DeviceTensor rows = state.tensor(images, 1, DType::u32, "table_row", 1);
    SR_CHECK(state.allocate(device, "golden case"));
    SR_CHECK(x.write_rows(device, input.sample));
    SR_CHECK(text.write_rows(device, input.text));
    SR_CHECK(steps.write(device, input.timesteps));
    SR_CHECK(rows.write(device, input.table_row));
    Graph g(device.limits());
    const Tensor table = unet->time_table(g, steps.in(g));
    Unet::Context context{{}, input.tokens, input.tokens};
    if (unet->context_width())
        context.table = unet->context_table(g, text.in(g));
    const FeatureMap y = unet->forward(g, input_map(g, x, input.shape), table, rows.in(g), context);
    GoldenOutputs out;
    SR_TRY(out.floats["sample"], run_and_read(device, g, y));
    return out;
}

Result<GoldenOutputs> run_unet_spatio_temporal_condition(Device& device, const GoldenCase& c, DType precision)
{
    SR_TRY(const Json json, read_config(c));
    SR_TRY(const UnetConfig config, parse_video_unet_config(json));
    SR_TRY(const Checkpoint weights, Checkpoint::open_folder(c.model(), Checkpoint::Network::unet));
    SR_TRY(const auto unet, Unet::load(device, config, weights, precision));
    SR_TRY(const VideoInput in, video_input(c, config));
    VideoSlots slots(*unet, in);
    SR_CHECK(slots.state.allocate(device, "golden case"));
    SR_CHECK(slots.write(device, in));
    SR_TRY(const auto tables, Executable::create(device, slots.tables_graph(device.limits(), *unet)));
    SR_CHECK(tables->run());
    Graph g(device.limits());
    const Unet::Context context{slots.keys.in(g), in.tokens, in.tokens};
    const Unet::Videos videos{{in.frames, slots.frames.in(g), slots.number.in(g)}, slots.video.in(g)};
    const FeatureMap y =
        unet->forward(g, input_map(g, slots.x, in.shape), slots.times.in(g), slots.image.in(g), context, videos);
    GoldenOutputs out;
    SR_TRY(out.floats["sample"], run_and_read(device, g, y));
    return out;
}

Result<GoldenOutputs> run_autoencoder_kl(Device& device, const GoldenCase& c, DType precision)
{
    SR_TRY(const Json json, read_config(c));
    SR_TRY(const VaeConfig config, parse_vae_config(json));
    return run_vae(device, c, config, precision);
}

Result<GoldenOutputs> run_autoencoder_kl_temporal_decoder(Device& device, const GoldenCase& c, DType precision)
{
    SR_TRY(const Json json, read_config(c));
    SR_TRY(const VaeConfig config, parse_video_vae_config(json));
    return run_vae(device, c, config, precision);
}

} // namespace semrover
