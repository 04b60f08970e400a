// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// golden kinds unet_2d_condition and autoencoder_kl
#include "engine/network/unet.h"
#include "engine/network/vae.h"
#include "runtime/base/json.h"
#include "runtime/device/program.h"
#include "tools/measure/evaluation_memory.h"
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

// NCHW to the rows of a feature map, with `ld` elements each
std::vector<float> to_rows(const std::vector<float>& values, const Shape& s)
{
    const uint32_t pixels = s.height * s.width, rows = round_up(pixels, kImageRowPadding);
    const uint32_t ld = round_up(s.channels, kRowPadding);
    std::vector<float> out(size_t(s.images) * rows * ld, 0.f);
    for (uint32_t i = 0; i < s.images; ++i)
        for (uint32_t c = 0; c < s.channels; ++c)
            for (uint32_t p = 0; p < pixels; ++p)
                out[(size_t(i) * rows + p) * ld + c] = values[(size_t(i) * s.channels + c) * pixels + p];
    return out;
}

std::vector<float> from_rows(const std::vector<float>& rows, const Shape& s)
{
    const uint32_t pixels = s.height * s.width, image_rows = round_up(pixels, kImageRowPadding);
    const uint32_t ld = round_up(s.channels, kRowPadding);
    std::vector<float> out(size_t(s.images) * s.channels * pixels);
    for (uint32_t i = 0; i < s.images; ++i)
        for (uint32_t c = 0; c < s.channels; ++c)
            for (uint32_t p = 0; p < pixels; ++p)
                out[(size_t(i) * s.channels + c) * pixels + p] = rows[(size_t(i) * image_rows + p) * ld + c];
    return out;
}

std::vector<uint16_t> to_halves(const std::vector<float>& values)
{
    std::vector<uint16_t> halves(values.size());
    std::transform(values.begin(), values.end(), halves.begin(), float_to_half);
    return halves;
}

uint32_t add_values(EvaluationMemory& memory, const std::vector<float>& values, DType dtype)
{
    return dtype == DType::f16 ? memory.add(to_halves(values)) : memory.add(values);
}

uint64_t fp32_bytes(const FeatureMap& map)
{
    return uint64_t(map.data.rows) * round_up(map.channels(), kRowPadding) * 4;
}

// runs the graph and reads the fp32 feature map `y` as NCHW
Result<std::vector<float>> run_and_read(Device& device, Graph& g, const FeatureMap& y)
{
    EvaluationMemory memory;
    const uint32_t out = memory.add_empty(fp32_bytes(y));
    SR_CHECK(memory.upload(device));
    g.replace(y.data.resource, g.external(memory.slice(out), y.data.rows, y.channels(), DType::f32, "output").resource);
    SR_TRY(const auto program, Program::create(device, g));
    SR_CHECK(program->run());
    std::vector<float> rows(fp32_bytes(y) / 4);
    SR_CHECK(device.read(memory.slice(out), std::as_writable_bytes(std::span(rows))));
    return from_rows(rows, {y.batch, y.channels(), y.height, y.width});
}

FeatureMap input_map(Graph& g, const BufferSlice& memory, const Shape& s, DType dtype)
{
    FeatureMap map{{}, s.images, s.height, s.width};
    map.data = g.external(memory, s.images * map.image_rows(), s.channels, dtype, "input");
    return map;
}

Result<Json> read_config(const GoldenCase& c)
{
    return read_json(c.model() / "config.json");
}

// one evaluation: every image has a timestep and a text of its own
struct UnetInput {
    Shape shape;
    uint32_t tokens = 0;
    std::vector<float> sample, text; // rows as on the device
    std::vector<float> timesteps;
    std::vector<uint32_t> table_row;
};

Result<UnetInput> unet_input(const GoldenCase& c, const UnetConfig& config)
{
    UnetInput in;
    SR_TRY(in.shape, shape_of(c, "input.sample"));
    const uint32_t dim = config.cross_attention_dim, ld = round_up(dim, kRowPadding);
    const std::vector<uint64_t> text = c.shape("input.encoder_hidden_states");
    if (text.size() != 3 || text[0] != in.shape.images || text[1] > 4096 || text[2] != dim)
        return fail(ErrorCode::bad_input, "input.encoder_hidden_states: expected [{}, tokens, {}]", in.shape.images,
                    dim);
    in.tokens = uint32_t(text[1]);
    in.sample = to_rows(c.floats("input.sample"), in.shape);
    const std::vector<float> given = c.floats("input.encoder_hidden_states");
    in.text.assign(given.size() / dim * ld, 0.f);
    for (size_t i = 0; i < given.size(); ++i)
        in.text[i / dim * ld + i % dim] = given[i];
    for (const int64_t t : c.integers("input.timestep"))
        in.timesteps.push_back(float(t));
    if (in.timesteps.size() != in.shape.images)
        return fail(ErrorCode::bad_input, "input.timestep: expected {} of them", in.shape.images);
    in.table_row.resize(in.shape.images);
    std::iota(in.table_row.begin(), in.table_row.end(), 0u);
    return in;
}

} // namespace

Result<GoldenOutputs> run_unet_2d_condition(Device& device, const GoldenCase& c, DType precision)
{
    SR_TRY(const Json json, read_config(c));
    SR_TRY(const UnetConfig config, parse_unet_config(json));
    SR_TRY(const Checkpoint weights, Checkpoint::open_folder(c.model(), Checkpoint::Network::unet));
    SR_TRY(const auto unet, Unet::load(device, config, weights, precision));
    SR_TRY(const UnetInput input, unet_input(c, config));
    EvaluationMemory memory;
    const uint32_t x = add_values(memory, input.sample, precision), text_id = add_values(memory, input.text, precision);
    const uint32_t steps = memory.add(input.timesteps), rows = memory.add(input.table_row);
    SR_CHECK(memory.upload(device));
    const uint32_t images = input.shape.images, text_rows = images * input.tokens;
    Graph g;
    const Tensor table = g.matrix(images, unet->time_width(), DType::f32, "time table");
    unet->time_table(g, g.external(memory.slice(steps), images, 1, DType::f32, "timesteps", 1), table);
    Unet::Context context{{}, input.tokens, input.tokens};
    if (unet->context_width()) {
        context.table = g.matrix(text_rows, unet->context_width(), precision, "context table");
        unet->context_table(
            g, g.external(memory.slice(text_id), text_rows, config.cross_attention_dim, precision, "context"),
            context.table);
    }
    const FeatureMap in = input_map(g, memory.slice(x), input.shape, precision);
    const FeatureMap y =
        unet->forward(g, in, table, g.external(memory.slice(rows), images, 1, DType::u32, "table_row", 1), context);
    GoldenOutputs out;
    SR_TRY(out.floats["sample"], run_and_read(device, g, y));
    return out;
}

Result<GoldenOutputs> run_autoencoder_kl(Device& device, const GoldenCase& c, DType precision)
{
    SR_TRY(const Json json, read_config(c));
    SR_TRY(const VaeConfig config, parse_vae_config(json));
    SR_TRY(const Checkpoint weights, Checkpoint::open_folder(c.model(), Checkpoint::Network::vae));
    SR_TRY(const auto vae, Vae::load(device, config, weights, precision));
    SR_TRY(const Shape image, shape_of(c, "input.image"));
    SR_TRY(const Shape latent, shape_of(c, "input.latent"));
    EvaluationMemory memory;
    const uint32_t image_id = memory.add(to_rows(c.floats("input.image"), image));
    const uint32_t latent_id = memory.add(to_rows(c.floats("input.latent"), latent));
    SR_CHECK(memory.upload(device));
    GoldenOutputs out;
    Graph encode;
    const FeatureMap in = input_map(encode, memory.slice(image_id), image, DType::f32);
    SR_TRY(const auto moments, run_and_read(device, encode, vae->encode(encode, in)));
    const size_t half = size_t(latent.channels) * latent.height * latent.width;
    for (size_t i = 0; i < latent.images; ++i) { // mean, log-variance, clamped as the reference does
        const auto* first = &moments[2 * half * i];
        out.floats["mean"].insert(out.floats["mean"].end(), first, first + half);
        for (size_t k = 0; k < half; ++k)
            out.floats["logvar"].push_back(std::clamp(first[half + k], -30.f, 20.f));
    }
    Graph decode;
    const FeatureMap z = input_map(decode, memory.slice(latent_id), latent, DType::f32);
    SR_TRY(out.floats["image"], run_and_read(device, decode, vae->decode(decode, z)));
    return out;
}

} // namespace semrover
