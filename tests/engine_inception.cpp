// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/inception_reference.h"
#include "tests/support/kernel_case.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"
#include "tools/eval/inception.h"

namespace semrover {
namespace engine_inception_test {

ImageRgb8 random_image(uint32_t width, uint32_t height, uint32_t seed)
{
    ImageRgb8 image{width, height, std::vector<uint8_t>(size_t(width) * height * 3)};
    std::mt19937 random(seed);
    for (size_t i = 0; i < image.pixels.size(); ++i) // smooth, so that resizing keeps something, and noise
        image.pixels[i] = uint8_t(128 + 90 * std::sin(double(i / 3 % width) / 9 + double(seed)) + random() % 37);
    return image;
}

// PyTorch's interpolate(size=(299, 299), mode="bilinear", align_corners=False), then 2 x - 1
Planes resized(const ImageRgb8& image)
{
    const int side = int(kInceptionSide), height = int(image.height), width = int(image.width);
    Planes y(3, side, side);
    for (int i = 0; i < side; ++i)
        for (int j = 0; j < side; ++j) {
            const double v = std::max((i + 0.5) * height / side - 0.5, 0.),
                         u = std::max((j + 0.5) * width / side - 0.5, 0.);
            const int y0 = int(v), x0 = int(u), y1 = std::min(y0 + 1, height - 1), x1 = std::min(x0 + 1, width - 1);
            for (int c = 0; c < 3; ++c) {
                const auto at = [&](int row, int col) {
                    return double(image.pixels[(size_t(row) * width + col) * 3 + c]);
                };
                const double top = at(y0, x0) + (u - x0) * (at(y0, x1) - at(y0, x0));
                const double bottom = at(y1, x0) + (u - x0) * (at(y1, x1) - at(y1, x0));
                y.at(c, i, j) = 2 * (top + (v - y0) * (bottom - top)) / 255 - 1;
            }
        }
    return y;
}

std::unique_ptr<Inception> load(const Path& path)
{
    auto network = Inception::load(test_device(), path);
    SR_ASSERT(bool(network), "{}", network.error().message);
    return std::move(*network);
}

TEST(engine_inception, features_of_a_tiny_network_match_a_naive_one_in_double)
{
    const ScratchFolder folder;
    const InceptionWeights tiny(24); // channels that fill no row: 2, 3, 4, 8, 16, ..
    tiny.weights.write(folder / "tiny.safetensors");
    const auto network = load(folder / "tiny.safetensors");
    ASSERT_EQ(network->features(), tiny.features);
    const std::vector<ImageRgb8> images = {random_image(123, 77, 1), random_image(123, 77, 2),
                                           random_image(123, 77, 3)};
    auto extractor = ImageFeatures::create(test_device(), *network, {123, 77}, 2);
    ASSERT_TRUE(extractor) << extractor.error().message;
    Features features;
    ASSERT_TRUE((*extractor)->append(std::span(images).subspan(0, 2), features));
    ASSERT_TRUE((*extractor)->append(std::span(images).subspan(2, 1), features)); // a batch that is not full
    ASSERT_EQ(features.rows, 3u);
    const InceptionReference reference(tiny.weights);
    for (const size_t i : {0u, 2u}) {
        const std::vector<double> expect = reference(resized(images[i]));
        ASSERT_EQ(expect.size(), features.cols);
        double largest = 0;
        for (const double v : expect)
            largest = std::max(largest, v);
        ASSERT_GT(largest, 0.05);
        for (size_t n = 0; n < expect.size(); ++n)
            ASSERT_NEAR(features.row(i)[n], expect[n], 1e-5 * largest) << "image " << i << " feature " << n;
    }
}

TEST(engine_inception, features_do_not_depend_on_the_batch)
{
    const ScratchFolder folder;
    const InceptionWeights tiny(32);
    tiny.weights.write(folder / "tiny.safetensors");
    const auto network = load(folder / "tiny.safetensors");
    std::vector<ImageRgb8> images;
    for (uint32_t i = 0; i < 3; ++i)
        images.push_back(random_image(40, 30, i));
    Features together, alone;
    auto three = ImageFeatures::create(test_device(), *network, {40, 30}, 3);
    auto one = ImageFeatures::create(test_device(), *network, {40, 30}, 1);
    ASSERT_TRUE(three && one);
    ASSERT_TRUE((*three)->append(images, together));
    for (const ImageRgb8& image : images)
        ASSERT_TRUE((*one)->append({&image, 1}, alone));
    EXPECT_EQ(together.values, alone.values);
}

TEST(engine_inception, batches_shrink_to_the_budget_and_an_image_that_does_not_fit_is_refused)
{
    const ScratchFolder folder;
    const InceptionWeights tiny(32);
    tiny.weights.write(folder / "tiny.safetensors");
    auto device = Device::create({.max_bytes = 22 << 20});
    ASSERT_TRUE(device) << device.error().message;
    auto network = Inception::load(**device, folder / "tiny.safetensors");
    ASSERT_TRUE(network) << network.error().message;
    auto extractor = ImageFeatures::create(**device, **network, {40, 30}, 8);
    ASSERT_TRUE(extractor) << extractor.error().message;
    EXPECT_GE((*extractor)->batch(), 1u);
    EXPECT_LT((*extractor)->batch(), 8u);
    EXPECT_LE((*device)->peak_bytes(), 24u << 20);
    auto small = Device::create({.max_bytes = 2 << 20});
    auto other = Inception::load(**small, folder / "tiny.safetensors");
    ASSERT_TRUE(other) << other.error().message;
    const auto refused = ImageFeatures::create(**small, **other, {40, 30}, 8);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::out_of_memory);
}

TEST(engine_inception, a_classifier_may_be_there_and_files_that_do_not_fit_are_refused_with_every_tensor)
{
    const ScratchFolder folder;
    const Path path = folder / "x.safetensors";
    const InceptionWeights tiny(64);
    const auto refused = [&](const StateDict& weights, std::string_view text) {
        weights.write(path);
        const auto network = Inception::load(test_device(), path);
        EXPECT_TRUE(says(network, text));
        EXPECT_TRUE(network || network.error().code == ErrorCode::bad_input);
    };
    StateDict with_fc = tiny.weights;
    with_fc.add("fc.weight", {1008, 7}, 1);
    with_fc.add("fc.bias", {1008}, 1);
    with_fc.write(path);
    EXPECT_TRUE(Inception::load(test_device(), path));

    StateDict w = tiny.weights;
    w.tensors.erase("Mixed_5b.branch5x5_2.bn.running_var");
    w.tensors.erase("Conv2d_1a_3x3.conv.weight");
    refused(w, "2 missing: Conv2d_1a_3x3.conv.weight [2, 3, 3, 3], Mixed_5b.branch5x5_2.bn.running_var [2]");
    w = tiny.weights;
    w.add("AuxLogits.conv0.conv.weight", {2, 2, 1, 1}, 1);
    refused(w, "1 unexpected: AuxLogits.conv0.conv.weight [2, 2, 1, 1]");
    w = tiny.weights;
    w.add("Mixed_6b.branch7x7_2.conv.weight", {2, 2, 7, 1}, 1);
    refused(w, "Mixed_6b.branch7x7_2.conv.weight expected [2, 2, 1, 7] found [2, 2, 7, 1]");
    w = tiny.weights;
    w.tensors["Mixed_7c.branch1x1.conv.weight"].second[1] = NAN;
    refused(w, "Mixed_7c.branch1x1.conv.weight");
    w = tiny.weights;
    w.tensors["Mixed_7a.branch3x3_1.bn.running_var"].second[0] = -1;
    refused(w, "tensor 'Mixed_7a.branch3x3_1.bn.running_var' holds -1 at element 0");
    w = tiny.weights;
    w.add("Mixed_6a.branch3x3.conv.weight", {9000, 1, 1, 1}, 1);
    refused(w, "Mixed_6a.branch3x3.conv.weight expected [6, ");
    StateDict none;
    none.add("x.weight", {1}, 1);
    refused(none, "expected tensors such as 'Conv2d_1a_3x3.conv.weight', found 1 others: another kind of network");
    EXPECT_TRUE(says(Inception::load(test_device(), folder.put("x.pth", "x")), "x.pth"));
    EXPECT_TRUE(says(Inception::load(test_device(), folder / "none.safetensors"), "No such file"));
    EXPECT_TRUE(says(Inception::load(test_device(), folder.put("cut.safetensors", "\x10")), "cut.safetensors"));
}

} // namespace engine_inception_test
} // namespace semrover
