// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/kernel_case.h"
#include "tests/support/lpips_reference.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"
#include "tools/eval/lpips.h"

namespace semrover {
namespace engine_lpips_test {

ImageRgb8 random_image(uint32_t width, uint32_t height, uint32_t seed)
{
    ImageRgb8 image{width, height, std::vector<uint8_t>(size_t(width) * height * 3)};
    std::mt19937 random(seed);
    for (size_t i = 0; i < image.pixels.size(); ++i)
        image.pixels[i] = uint8_t(128 + 80 * std::sin(double(i / 3 % width) / 9 + double(i % 3)) + random() % 40);
    return image;
}

std::unique_ptr<Lpips> load(const StateDict& weights, const Path& path)
{
    weights.write(path);
    auto network = Lpips::load(test_device(), path);
    SR_ASSERT(bool(network), "{}", network.error().message);
    return std::move(*network);
}

double distance(Lpips& network, const ImageRgb8& a, const ImageRgb8& b)
{
    const Result<double> d = network.distance(a, b);
    EXPECT_TRUE(d) << d.error().message;
    return d ? *d : NAN;
}

struct NetworkCase {
    bool vgg;
    int divisor;
    std::vector<ImageSize> sizes;
};
// the least size, odd ones, and of a wider VGG16 one whose convolutions go through Winograd on a CPU
const NetworkCase kCases[] = {{false, 16, {{31, 31}, {67, 45}, {123, 78}, {40, 32}}},
                              {true, 16, {{16, 16}, {67, 45}, {31, 50}}},
                              {true, 4, {{251, 131}}}};

TEST(engine_lpips, matches_a_naive_one_in_double)
{
    const ScratchFolder folder;
    for (const NetworkCase& c : kCases) {
        const LpipsReference reference(c.vgg, c.divisor);
        const auto network = load(reference.weights, folder / "n.safetensors");
        ASSERT_EQ(network->backbone(), c.vgg ? "vgg" : "alex");
        for (const ImageSize size : c.sizes) {
            SCOPED_TRACE(fmt::format("{} {} x {}", network->backbone(), size.width, size.height));
            ASSERT_LE(network->least_side(), std::min(size.width, size.height));
            const ImageRgb8 a = random_image(size.width, size.height, 1), b = random_image(size.width, size.height, 2);
            const double expect = reference(a, b);
            ASSERT_GT(expect, 0.01);
            EXPECT_NEAR(distance(*network, a, b), expect, 1e-5 * expect);
            EXPECT_NEAR(distance(*network, b, a), expect, 1e-5 * expect);
            EXPECT_EQ(distance(*network, a, a), 0);
        }
    }
}

TEST(engine_lpips, one_changed_pixel_is_seen_and_more_noise_is_farther)
{
    const ScratchFolder folder;
    const auto network = load(LpipsReference(false, 16).weights, folder / "n.safetensors");
    const ImageRgb8 a = random_image(64, 48, 3);
    double last = 0;
    for (const uint32_t changed : {1u, 30u, 1000u}) {
        ImageRgb8 b = a;
        std::mt19937 random(1);
        for (uint32_t i = 0; i < changed; ++i)
            b.pixels[random() % b.pixels.size()] ^= 0x40;
        const double d = distance(*network, a, b);
        EXPECT_GT(d, last);
        last = d;
    }
}

TEST(engine_lpips, files_that_do_not_fit_are_refused_with_every_tensor)
{
    const ScratchFolder folder;
    const Path path = folder / "x.safetensors";
    const auto refused = [&](const StateDict& weights, std::string_view text) {
        weights.write(path);
        const auto network = Lpips::load(test_device(), path);
        EXPECT_TRUE(says(network, text));
        EXPECT_TRUE(network || network.error().code == ErrorCode::bad_input);
    };
    const StateDict alex = LpipsReference(false, 16).weights, vgg = LpipsReference(true, 16).weights;
    StateDict w = alex;
    w.add("classifier.1.weight", {5, 4}, 1); // of a state dict that was not cut
    w.add("scaling_layer.shift", {1, 3, 1, 1}, 1);
    w.write(path);
    EXPECT_TRUE(Lpips::load(test_device(), path));

    w = alex;
    w.tensors.erase("features.6.bias");
    w.tensors.erase("lin3.model.1.weight");
    refused(w, "2 missing: features.6.bias [24], lin3.model.1.weight [1, 16, 1, 1]");
    w = vgg;
    w.tensors.erase("features.28.weight");
    refused(w, "1 missing: features.28.weight [");
    w = vgg;
    w.add("features.30.weight", {8, 32, 3, 3}, 1); // VGG19 goes on
    refused(w, "1 unexpected: features.30.weight [8, 32, 3, 3]");
    w = alex;
    w.add("features.3.weight", {12, 4, 3, 3}, 1);
    refused(w, "features.3.weight expected [12, 4, 5, 5] found [12, 4, 3, 3]");
    w = alex;
    w.add("lin1.model.1.weight", {1, 13, 1, 1}, 1);
    refused(w, "lin1.model.1.weight expected [1, 12, 1, 1] found [1, 13, 1, 1]");
    w = alex;
    w.add("lin2.model.1.weight", {2, 24, 1, 1}, 1);
    refused(w, "lin2.model.1.weight has 2 outputs, expected 1");
    w = alex;
    w.tensors["features.8.weight"].second[3] = NAN;
    refused(w, "features.8.weight");
    StateDict none;
    none.add("x.weight", {1}, 1);
    refused(none, "expected tensors such as 'features.0.weight', found 1 others: another kind of network");
    EXPECT_TRUE(says(Lpips::load(test_device(), folder / "none.safetensors"), "No such file"));
}

TEST(engine_lpips, a_pair_that_does_not_fit_the_budget_is_refused)
{
    const ScratchFolder folder;
    LpipsReference(false, 16).weights.write(folder / "n.safetensors");
    auto device = Device::create({.max_bytes = 4 << 20});
    ASSERT_TRUE(device) << device.error().message;
    auto network = Lpips::load(**device, folder / "n.safetensors");
    ASSERT_TRUE(network) << network.error().message;
    const ImageRgb8 large = random_image(900, 700, 1), small = random_image(40, 40, 2);
    const auto refused = (*network)->distance(large, large);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::out_of_memory);
    EXPECT_EQ(distance(**network, small, small), 0); // and the network goes on
}

} // namespace engine_lpips_test
} // namespace semrover
