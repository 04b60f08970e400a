// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device posix
#include "kernels/network.h"
#include "runtime/device/device.h"
#include "runtime/device/executable.h"
#include "runtime/device/pipeline.h"
#include "tests/support/cache_home.h"

#include <gtest/gtest.h>
#include <random>

namespace semrover {
namespace runtime_autotune_test {

constexpr uint32_t kSize = 192;
const DeviceOptions kLikeAGpu{.limits = "variant=simt,submit=1,coopmat=0"};

std::unique_ptr<Device> make_device(const DeviceOptions& options)
{
    auto device = Device::create(options);
    SR_ASSERT(bool(device), "{}", device.error().message);
    return std::move(*device);
}

// y = x w^T, and that once more
class Product {
  public:
    explicit Product(Device& device) : device_(device)
    {
        std::mt19937 random(3);
        std::normal_distribution<float> normal(0, 0.1f);
        for (auto* buffer : {&x_, &w_, &y_}) {
            auto made = Buffer::create(device, kSize * kSize * 4, MemoryKind::device, "test");
            SR_ASSERT(bool(made), "{}", made.error().message);
            *buffer = std::move(*made);
            std::vector<float> numbers(kSize * kSize);
            for (float& number : numbers)
                number = normal(random);
            EXPECT_TRUE(device.write((*buffer)->slice(), std::as_bytes(std::span(numbers))));
        }
        Graph g(device.limits());
        const auto matrix = [&](const Buffer& b) { return g.external(b.slice(), kSize, kSize, DType::f32, "test"); };
        const Tensor w = matrix(*w_);
        (void)gemm(g, gemm(g, matrix(*x_), w, {}, {.dtype = DType::f32}), w, {},
                   {.dtype = DType::f32, .part = {.whole = matrix(*y_)}});
        auto executable = Executable::create(device, g);
        SR_ASSERT(bool(executable), "{}", executable.error().message);
        executable_ = std::move(*executable);
    }
    std::vector<std::byte> run()
    {
        std::vector<std::byte> bytes(y_->bytes());
        EXPECT_TRUE(executable_->run());
        EXPECT_TRUE(device_.read(y_->slice(), bytes));
        return bytes;
    }
    uint32_t tile() const { return executable_->plan().passes[0].grid.tile.rows; }

  private:
    Device& device_;
    std::unique_ptr<Buffer> x_, w_, y_;
    std::unique_ptr<Executable> executable_;
};

TEST(runtime_autotune, tries_tiles_with_the_same_bytes_and_keeps_one)
{
    const CacheHome home;
    const auto device = make_device(kLikeAGpu);
    Product product(*device);
    std::vector<uint32_t> tried;
    const std::vector<std::byte> first = product.run();
    for (int i = 0; i < 8; ++i) {
        tried.push_back(product.tile());
        EXPECT_EQ(product.run(), first) << i;
    }
    EXPECT_EQ(std::vector(tried.begin(), tried.begin() + 4), (std::vector<uint32_t>{32, 64, 32, 64}));
    ASSERT_EQ(device->tuning().size(), 1u); // both products take alike
    EXPECT_EQ(tried[5], tried[7]);
    EXPECT_EQ(Product(*device).tile(), tried[7]);
}

TEST(runtime_autotune, keeps_what_it_found_in_the_pipeline_cache)
{
    const CacheHome home;
    std::string found;
    std::vector<char> blob;
    {
        const auto device = make_device(kLikeAGpu);
        Product product(*device);
        for (int i = 0; i < 5; ++i)
            (void)product.run();
        found = device->tuning().text();
        blob = *device->pipelines().blob();
    }
    ASSERT_FALSE(found.empty());
    EXPECT_EQ(make_device(kLikeAGpu)->tuning().text(), found);
    DeviceOptions with_blob = kLikeAGpu;
    with_blob.pipeline_cache = std::as_bytes(std::span(blob));
    EXPECT_EQ(make_device(with_blob)->tuning().text(), found);
    blob[20] ^= 1; // of the text: the checksum is of all
    with_blob.pipeline_cache = std::as_bytes(std::span(blob));
    EXPECT_EQ(make_device(with_blob)->tuning().text(), "");
}

TEST(runtime_autotune, tries_nothing_where_it_is_off_or_nothing_is_timed)
{
    const CacheHome home;
    DeviceOptions off = kLikeAGpu, untimed = kLikeAGpu;
    off.autotune = false;
    untimed.limits = "variant=simt,coopmat=0";
    for (const DeviceOptions& options : {off, untimed}) {
        const auto device = make_device(options);
        if (options.autotune && device->limits().submit_seconds > 0)
            continue; // a GPU's first runs are timed
        Product product(*device);
        const uint32_t tile = product.tile();
        for (int i = 0; i < 6; ++i) {
            (void)product.run();
            EXPECT_EQ(product.tile(), tile);
        }
        EXPECT_EQ(device->tuning().size(), 0u);
    }
}

} // namespace runtime_autotune_test
} // namespace semrover
