// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/model/weight_loader.h"
#include "tests/support/kernel_case.h"

namespace semrover {
namespace engine_weight_loader_test {

// tensors of random numbers in a type, as a file has them
class File {
  public:
    explicit File(DType dtype) : dtype_(dtype) {}
    void add(const TensorSpec& spec)
    {
        size_t count = 1;
        for (const uint64_t n : spec.shape)
            count *= n;
        std::normal_distribution<float> normal(0, 1);
        std::vector<float> numbers(count);
        for (float& v : numbers)
            v = normal(random_);
        std::vector<std::byte>& bytes = tensors_[spec.name];
        bytes.resize(count * dtype_bytes(dtype_));
        from_float(numbers, dtype_, bytes.data());
    }
    void set(const std::string& name, size_t element, float value)
    {
        from_float({&value, 1}, dtype_, &tensors_[name][element * dtype_bytes(dtype_)]);
    }
    float at(const std::string& name, size_t element) const
    {
        float value = 0;
        const size_t bytes = dtype_bytes(dtype_);
        to_float(std::span(tensors_.at(name)).subspan(element * bytes, bytes), dtype_, &value);
        return value;
    }
    Result<TensorValues> values(const TensorSpec& spec, std::vector<float>&) const
    {
        return TensorValues{tensors_.at(spec.name), dtype_, "weights.safetensors", spec.name};
    }

  private:
    DType dtype_;
    std::mt19937 random_{7};
    std::map<std::string, std::vector<std::byte>> tensors_;
};

uint32_t place_of(const IndexRanges& runs, uint32_t from)
{
    for (const IndexRange& run : runs)
        if (from >= run.from && from < run.from + run.count)
            return run.to + from - run.from;
    return ~0u;
}

// what the comment of WeightPart says, element by element
std::vector<float> expected(const WeightLayout& w, const File& file)
{
    const DeviceTensor& slot = w.weight;
    std::vector<float> all(size_t(slot.rows()) * slot.ld());
    for (const WeightPart& p : w.parts) {
        const uint32_t rows = uint32_t(p.rows.back().from + p.rows.back().count);
        float share = 1;
        if (p.share) {
            const double sigmoid = 1 / (1 + std::exp(-double(file.at(p.share->mix_factor, 0))));
            share = float(p.share->switched ? sigmoid : 1 - sigmoid);
        }
        for (uint32_t r = 0; r < rows; ++r)
            for (uint32_t c = 0; c < p.cols_of_row; ++c)
                for (uint32_t t = 0; t < p.taps; ++t) {
                    const float v =
                        p.spec.name.empty() ? 1 : file.at(p.spec.name, (size_t(r) * p.cols_of_row + c) * p.taps + t);
                    all[size_t(place_of(p.rows, r)) * slot.ld() + t * p.tap_width + place_of(p.cols, c)] =
                        p.gain * (share * v);
                }
    }
    std::vector<std::byte> bytes(all.size() * dtype_bytes(slot.dtype()));
    from_float(all, slot.dtype(), bytes.data());
    to_float(bytes, slot.dtype(), all.data());
    return all;
}

WeightPart conv_part(const std::string& name, uint32_t outputs, uint32_t first, uint32_t second, float gain)
{
    WeightPart p{{name, {outputs, first + second, 3, 3}}, first + second, straight(outputs), straight(first)};
    if (second)
        p.cols.push_back({first, round_up(first, 8), second});
    p.taps = 9;
    p.tap_width = round_up(first, 8) + round_up(second, 8);
    p.gain = gain;
    return p;
}

struct Network {
    TensorPool state;
    std::vector<WeightLayout> weights;
    File file;

    explicit Network(DType in_file, DType on_device) : file(in_file)
    {
        const auto add = [&](uint32_t rows, uint32_t cols, std::vector<WeightPart> parts) {
            weights.push_back({state.tensor(rows, cols, on_device, "weight"), std::move(parts)});
        };
        add(37, 64, {{{"as it lies", {37, 64}}, 64, straight(37), straight(64)}});
        add(37, 61, {{{"padded", {37, 61}}, 61, straight(37), straight(61)}});
        add(5, 9 * 16, {conv_part("taps", 5, 11, 0, 1)});
        add(7, 9 * 24, {conv_part("two inputs", 7, 10, 5, 0.25f)});
        add(80, 3 * 16,
            {{{"heads", {30, 30}}, 30, of_heads(30, 3), of_heads(30, 3)},
             {{"gates", {20, 30}}, 30, interleaved(20, 48), of_heads(30, 3)}});
        add(16, 64,
            {{{"upper", {6, 64}}, 64, straight(6, 9), straight(64)},
             {{"swapped", {8, 64}}, 64, {{0, 4, 4}, {4, 0, 4}}, straight(64)}});
        add(2, 40, {{{"bias", {20}}, 20, straight(1, 1), straight(20, 20)}});
        weights.back().parts.back().share = {"mix", true};
        add(1, 1, {{{"", {1}}, 1, straight(1), straight(1)}});
        weights.back().parts.back().share = {"mix", false};
        for (const TensorSpec& spec : schema_of(weights))
            file.add(spec);
    }
    Status load(Device& device)
    {
        return load_weights(device, weights, [&](const TensorSpec& spec, auto& s) { return file.values(spec, s); });
    }
};

TEST(engine_weight_loader, puts_every_element_where_its_layout_says)
{
    for (const char* limits : {"", "staging=1"}) {
        auto device = Device::create({.limits = limits});
        ASSERT_TRUE(device) << device.error().message;
        for (const DType in_file : {DType::f16, DType::bf16, DType::f32})
            for (const DType on_device : {DType::f16, DType::f32}) {
                Network n(in_file, on_device);
                ASSERT_TRUE(n.state.allocate(**device, "weights"));
                const Status loaded = n.load(**device);
                ASSERT_TRUE(loaded) << loaded.error().message;
                for (const WeightLayout& w : n.weights) {
                    std::vector<std::byte> bytes(w.weight.bytes());
                    ASSERT_TRUE((*device)->read(w.weight.slice(), bytes));
                    std::vector<float> got(bytes.size() / dtype_bytes(on_device));
                    to_float(bytes, on_device, got.data());
                    EXPECT_EQ(got, expected(w, n.file)) << w.parts.front().spec.name << ' ' << dtype_name(in_file);
                }
            }
    }
}

TEST(engine_weight_loader, refuses_what_is_no_number_and_what_the_type_cannot_hold)
{
    for (const char* tensor : {"as it lies", "padded", "taps"}) {
        for (const DType in_file : {DType::f16, DType::f32}) {
            Network n(in_file, DType::f16);
            ASSERT_TRUE(n.state.allocate(test_device(), "weights"));
            n.file.set(tensor, 70, std::numeric_limits<float>::quiet_NaN());
            const Status status = n.load(test_device());
            ASSERT_FALSE(status);
            EXPECT_EQ(status.error().code, ErrorCode::bad_input);
            EXPECT_NE(status.error().message.find("holds NaN or infinity, first at element 70 of"), std::string::npos)
                << status.error().message;
        }
        Network n(DType::f32, DType::f16);
        ASSERT_TRUE(n.state.allocate(test_device(), "weights"));
        n.file.set(tensor, 70, -70000);
        const Status status = n.load(test_device());
        ASSERT_FALSE(status);
        EXPECT_NE(status.error().message.find("holds -70000, which F16 cannot hold"), std::string::npos)
            << status.error().message;
    }
}

// weights in blocks: files of int8 with scales, and of numbers
class BlockFile {
  public:
    explicit BlockFile(DType dtype) : dtype_(dtype), numbers_(dtype == DType::i8 ? DType::f16 : dtype) {}
    void add(const TensorSpec& spec)
    {
        if (dtype_ != DType::i8 || spec.shape.size() < 2)
            return numbers_.add(spec);
        TensorSpec scales{spec.name + "_scale", spec.shape};
        scales.shape[1] /= 32;
        numbers_.add(scales);
        size_t count = 1;
        for (const uint64_t n : spec.shape)
            count *= n;
        for (size_t i = 0; i < count; ++i)
            int8_[spec.name].push_back(std::byte(random_()));
    }
    void set(const std::string& name, size_t element, float value) { numbers_.set(name, element, value); }
    // [rows, cols, taps]
    float at(const std::string& name, uint32_t row, uint32_t col, uint32_t tap, uint32_t cols, uint32_t taps) const
    {
        const size_t at = (size_t(row) * cols + col) * taps + tap;
        if (!int8_.contains(name))
            return numbers_.at(name, at);
        const float scale = numbers_.at(name + "_scale", (size_t(row) * (cols / 32) + col / 32) * taps + tap);
        return scale * float(int8_t(int8_.at(name)[at]));
    }
    Result<TensorValues> values(const TensorSpec& spec, std::vector<float>& scratch) const
    {
        if (int8_.contains(spec.name))
            return TensorValues{int8_.at(spec.name), DType::i8, "weights.safetensors", spec.name};
        return numbers_.values(spec, scratch);
    }

  private:
    DType dtype_;
    File numbers_;
    std::mt19937 random_{11};
    std::map<std::string, std::vector<std::byte>> int8_;
};

struct BlockNetwork {
    TensorPool state;
    std::vector<WeightLayout> weights;
    BlockFile file;

    explicit BlockNetwork(DType in_file) : file(in_file)
    {
        const auto add = [&](uint32_t rows, uint32_t cols, std::vector<WeightPart> parts) {
            weights.push_back({state.tensor(rows, cols, DType::q8_0, "weight"), std::move(parts)});
        };
        add(37, 64, {{{"as it lies", {37, 64}}, 64, straight(37), straight(64)}});
        add(5, 9 * 32, {conv_part("taps", 5, 32, 0, 1)});
        add(7, 9 * 320, {conv_part("two inputs", 7, 48, 272, 0.25f)}); // a block of both
        add(80, 96,
            {{{"heads", {30, 96}}, 96, of_heads(30, 3), of_heads(96, 4)},
             {{"gates", {20, 96}}, 96, interleaved(20, 48), straight(96)}});
        add(16, 544,
            {{{"upper", {6, 544}}, 544, straight(6, 9), straight(544)},
             {{"swapped", {8, 544}}, 544, {{0, 4, 4}, {4, 0, 4}}, straight(544)}});
        weights.back().parts.back().share = {"mix", true};
        for (const TensorSpec& spec : schema_of(weights))
            file.add(spec);
    }
    Status load(Device& device)
    {
        return load_weights(device, weights, [&](const TensorSpec& spec, auto& s) { return file.values(spec, s); });
    }
    // one that is stored, with what it is multiplied by
    float expected(const WeightPart& p, uint32_t row, uint32_t col, uint32_t tap) const
    {
        const float share =
            p.share ? float(1 / (1 + std::exp(-double(file.at(p.share->mix_factor, 0, 0, 0, 1, 1))))) : 1;
        return p.gain * share * file.at(p.spec.name, row, col, tap, p.cols_of_row, p.taps);
    }
};

// an element of a weight on the device: int8 of a row, then its scales
float element_of(const DeviceTensor& weight, const std::vector<std::byte>& bytes, uint32_t row, uint32_t col)
{
    const size_t row_bytes = (weight.ld() + weight.ld() / 16 + 15) / 16 * 16, at = row * row_bytes;
    uint16_t scale = 0;
    std::memcpy(&scale, &bytes[at + weight.ld() + col / 32 * 2], 2);
    return half_to_float(scale) * float(int8_t(bytes[at + col]));
}

TEST(engine_weight_loader, puts_blocks_where_their_layout_says)
{
    for (const DType in_file : {DType::i8, DType::f16, DType::f32}) {
        BlockNetwork n(in_file);
        ASSERT_TRUE(n.state.allocate(test_device(), "weights"));
        const Status loaded = n.load(test_device());
        ASSERT_TRUE(loaded) << loaded.error().message;
        for (const WeightLayout& w : n.weights) {
            std::vector<std::byte> bytes(w.weight.bytes());
            ASSERT_TRUE(test_device().read(w.weight.slice(), bytes));
            double written = 0, all = 0;
            for (const WeightPart& p : w.parts)
                for (uint32_t r = 0; r < p.spec.shape[0]; ++r)
                    for (uint32_t c = 0; c < p.cols_of_row; ++c)
                        for (uint32_t t = 0; t < p.taps; ++t) {
                            const float got =
                                element_of(w.weight, bytes, place_of(p.rows, r), t * p.tap_width + place_of(p.cols, c));
                            const float v = n.expected(p, r, c, t);
                            float largest = 0; // of the block: half a 127th of it is lost where numbers become blocks
                            for (uint32_t i = 0; i < 32; ++i)
                                largest = std::max(largest, std::abs(n.expected(p, r, c / 32 * 32 + i, t)));
                            const float lost = in_file == DType::i8 ? 5e-4f * std::abs(v) : largest / 250;
                            ASSERT_NEAR(got, v, lost + 1e-7f) << p.spec.name << ' ' << r << ' ' << c << ' ' << t;
                            written += got * got;
                        }
            for (uint32_t r = 0; r < w.weight.rows(); ++r)
                for (uint32_t c = 0; c < w.weight.cols(); ++c)
                    all += std::pow(element_of(w.weight, bytes, r, c), 2);
            EXPECT_NEAR(all, written, 1e-6 * all); // what nothing goes to is zero
        }
    }
}

TEST(engine_weight_loader, refuses_a_scale_that_is_no_number)
{
    BlockNetwork n(DType::i8);
    ASSERT_TRUE(n.state.allocate(test_device(), "weights"));
    n.file.set("taps_scale", 20, std::numeric_limits<float>::infinity());
    const Status status = n.load(test_device());
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, ErrorCode::bad_input);
    EXPECT_NE(status.error().message.find("'weights.safetensors': tensor 'taps_scale' holds NaN or infinity, first at "
                                          "element 20 of 45"),
              std::string::npos)
        << status.error().message;
}

// rows of several pieces of staging
TEST(engine_weight_loader, loads_what_is_larger_than_its_window)
{
    auto device = Device::create({.limits = "staging=1"});
    ASSERT_TRUE(device) << device.error().message;
    TensorPool state;
    const std::vector<WeightLayout> weights{{state.tensor(3000, 2048, DType::f32, "large"),
                                             {{{"large", {3000, 2048}}, 2048, straight(3000), straight(2048)}}}};
    ASSERT_TRUE(state.allocate(**device, "weights"));
    File file(DType::f32);
    file.add(weights[0].parts[0].spec);
    uint64_t told = 0;
    const Status loaded = load_weights(
        **device, weights, [&](const TensorSpec& spec, auto& s) { return file.values(spec, s); },
        [&](uint64_t bytes) {
            told += bytes;
            return Status();
        });
    ASSERT_TRUE(loaded) << loaded.error().message;
    EXPECT_EQ(told, weights[0].weight.bytes());
    std::vector<float> got(3000 * 2048);
    ASSERT_TRUE((*device)->read(weights[0].weight.slice(), std::as_writable_bytes(std::span(got))));
    for (size_t i = 0; i < got.size(); i += 1009)
        ASSERT_EQ(got[i], file.at("large", i));
}

} // namespace engine_weight_loader_test
} // namespace semrover
