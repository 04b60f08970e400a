// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device posix
#include "kernels/network.h"
#include "runtime/base/json.h"
#include "runtime/device/device.h"
#include "runtime/device/executable.h"
#include "runtime/device/pipeline.h"
#include "runtime/device/profile.h"
#include "runtime/device/tensor_pool.h"
#include "tests/support/cache_home.h"
#include "tests/support/host_vulkan.h"
#include "tests/support/json_text.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <algorithm>
#include <cstring>
#include <fstream>

namespace semrover {
namespace runtime_device_test {

using Bytes = std::vector<std::byte>;

std::unique_ptr<Device> make_device(const DeviceOptions& options = {})
{
    auto device = Device::create(options);
    SR_ASSERT(bool(device), "{}", device.error().message);
    return std::move(*device);
}

std::unique_ptr<Buffer> make_buffer(Device& device, uint64_t bytes)
{
    auto buffer = Buffer::create(device, bytes, MemoryKind::device, "test");
    SR_ASSERT(bool(buffer), "{}", buffer.error().message);
    return std::move(*buffer);
}

Bytes pattern(size_t bytes)
{
    Bytes p(bytes);
    for (size_t i = 0; i < bytes; ++i)
        p[i] = std::byte(i * 167 + i / 251);
    return p;
}

// x + x, then gelu, then x + that: two passes between levels, into `out`
Graph small_graph(const DeviceLimits& limits, const Buffer& x, const Buffer& out)
{
    Graph g(limits);
    const Tensor a = g.external(x.slice(), 16, 64, DType::f32, "x"),
                 b = g.external(out.slice(), 16, 64, DType::f32, "out");
    add(g, gelu(g, add(g, a, a)), a, {.whole = b});
    return g;
}

void run_small_graph(Device& device)
{
    const auto x = make_buffer(device, 4096), out = make_buffer(device, 4096);
    const std::vector<float> ones(1024, 1.f);
    ASSERT_TRUE(device.write(x->slice(), std::as_bytes(std::span(ones))));
    auto executable = Executable::create(device, small_graph(device.limits(), *x, *out));
    ASSERT_TRUE(executable) << executable.error().message;
    const Status status = (*executable)->run();
    ASSERT_TRUE(status) << status.error().message;
    std::vector<float> y(1024);
    ASSERT_TRUE(device.read(out->slice(), std::as_writable_bytes(std::span(y))));
    for (float v : y)
        ASSERT_NEAR(v, 1 + 1.9545977, 1e-6); // gelu(2)
}

TEST(runtime_device, lists_what_there_is_with_limits_that_vulkan_promises)
{
    const auto devices = list_devices();
    ASSERT_TRUE(devices) << devices.error().message;
    ASSERT_FALSE(devices->empty());
    for (uint32_t i = 0; i < devices->size(); ++i) {
        const DeviceSummary& d = (*devices)[i];
        EXPECT_EQ(d.index, i);
        EXPECT_FALSE(d.name.empty());
        EXPECT_FALSE(d.driver.empty());
        EXPECT_GE(d.limits.max_shared_bytes, 16384u);
        EXPECT_GE(d.limits.max_group_threads, 128u);
        EXPECT_GE(d.limits.max_storage_range, 1u << 27);
        EXPECT_EQ(d.limits.offset_alignment & (d.limits.offset_alignment - 1), 0u);
        EXPECT_GT(d.memory_bytes, 0u);
    }
}

TEST(runtime_device, is_chosen_by_index_or_by_a_part_of_its_name)
{
    const auto devices = list_devices();
    ASSERT_TRUE(devices);
    const DeviceSummary& first = devices->front();
    EXPECT_EQ(make_device()->name(), first.name);
    EXPECT_EQ(make_device({.select = "0"})->name(), first.name);
    EXPECT_EQ(make_device({.select = first.name})->name(), first.name);
    EXPECT_EQ(make_device({.select = first.name.substr(1, 4)})->name(), first.name);
}

TEST(runtime_device, says_what_there_is_when_nothing_matches)
{
    const std::string name = list_devices()->front().name;
    for (const char* select : {"nonesuch", "99"}) {
        const auto device = Device::create({.select = select});
        EXPECT_TRUE(says(device, fmt::format("no usable device matches '{}'; there are: 0: {}", select, name)));
        EXPECT_EQ(device.error().code, ErrorCode::no_device);
    }
}

TEST(runtime_device, refuses_limits_that_it_cannot_lower)
{
    const std::pair<const char*, const char*> cases[] = {
        {"shared", "limit 'shared': expected name=value"},
        {"", ""},
        {"shared=", "limit 'shared': '' is not a number"},
        {"shared=-1", "limit 'shared': '-1' is not a number"},
        {"shared=12k", "limit 'shared': '12k' is not a number"},
        {"range=nan", "limit 'range': 'nan' is not a number"},
        {"range=1e18", "limit 'range': 1e+18 is more than the device's"},
        {"alloc=inf", "limit 'alloc': inf is more than the device's"},
        {"colour=1", "unknown limit 'colour' (known: shared, range, "},
    };
    for (const auto& [text, message] : cases) {
        const auto device = Device::create({.limits = text});
        if (!*message) {
            EXPECT_TRUE(device);
            continue;
        }
        EXPECT_TRUE(says(device, message)) << text;
        EXPECT_EQ(device.error().code, ErrorCode::usage);
    }
}

TEST(runtime_device, takes_every_limit_that_it_can_lower)
{
    const auto device = make_device({.limits = "shared=8192,range=1e6,texels=4096,alloc=2e6,groups=100,fp16=0,"
                                               "subgroups=0,staging=1,branches=1,submit=0.5,variant=simt"});
    const DeviceLimits& l = device->limits();
    EXPECT_EQ(l.max_shared_bytes, 8192u);
    EXPECT_EQ(l.max_storage_range, 1000000u);
    EXPECT_EQ(l.max_texel_elements, 4096u);
    EXPECT_EQ(l.max_allocation, 2000000u);
    EXPECT_EQ(l.max_groups, 100u);
    EXPECT_EQ(l.features & (kFeatureFloat16 | kFeatureSubgroupBallot), 0u);
    EXPECT_TRUE(l.force_staging && l.side_by_side);
    EXPECT_EQ(l.submit_seconds, 0.5);
    EXPECT_EQ(l.force_variant, "simt");
}

TEST(runtime_device, refuses_memory_beyond_the_budget_with_numbers)
{
    const auto device = make_device({.max_bytes = 1 << 20});
    const auto some = make_buffer(*device, 300000);
    const uint64_t used = device->allocated_bytes();
    EXPECT_GE(used, 300000u);
    const auto more = Buffer::create(*device, 900096, MemoryKind::device, "weights");
    EXPECT_TRUE(says(more, fmt::format("weights: 900096 bytes do not fit: {} in use, `max_bytes` 1048576", used)));
    EXPECT_EQ(more.error().code, ErrorCode::out_of_memory);
    EXPECT_EQ(device->allocated_bytes(), used);
    Graph g(device->limits());
    const Tensor x = g.external(some->slice(), 64, 1024, DType::f32, "x");
    (void)gelu(g, silu(g, gelu(g, x))); // two of 262144 bytes at a time fit, but not three
    EXPECT_TRUE(Executable::create(*device, g));
    const auto little = make_buffer(*device, 500000);
    EXPECT_TRUE(says(Executable::create(*device, g), "graph arena: 524288 bytes do not fit"));
    EXPECT_EQ(device->budget(), 1u << 20);
}

TEST(runtime_device, copies_through_staging_when_the_budget_is_used_up)
{
    const auto device = make_device({.limits = "staging=1", .max_bytes = 1 << 20});
    const auto all = make_buffer(*device, 1 << 20);
    EXPECT_EQ(all->mapped(), nullptr);
    const Bytes bytes = pattern(1 << 20);
    const Status written = device->write(all->slice(), bytes);
    ASSERT_TRUE(written) << written.error().message;
    Bytes back(bytes.size());
    ASSERT_TRUE(device->read(all->slice(), back));
    EXPECT_EQ(back, bytes);
    EXPECT_EQ(device->peak_bytes(), 1u << 20);
}

TEST(runtime_device, refuses_one_allocation_that_is_too_large_with_numbers)
{
    const auto device = make_device({.limits = "alloc=1048576"});
    for (uint64_t bytes : {uint64_t(1048577), uint64_t(1) << 40, ~uint64_t(0)}) {
        const auto buffer = Buffer::create(*device, bytes, MemoryKind::device, "grid");
        EXPECT_TRUE(
            says(buffer, fmt::format("grid: {} bytes exceed the device's largest allocation of 1048576 bytes", bytes)));
        EXPECT_EQ(buffer.error().code, ErrorCode::out_of_memory);
    }
    EXPECT_EQ(device->allocated_bytes(), 0u);
    TensorPool state;
    for (int i = 0; i < 5; ++i)
        (void)state.tensor(100000, 1, DType::u32, "slot", 1); // two a block
    EXPECT_EQ(state.planned_bytes(device->limits()), 5 * 400128u);
    ASSERT_TRUE(state.allocate(*device, "state"));
    EXPECT_EQ(device->allocated_bytes(), 5 * 400128u);
}

TEST(runtime_device, has_all_its_memory_back_after_a_hundred_executables)
{
    const auto device = make_device();
    run_small_graph(*device); // staging, if any
    const uint64_t start = device->allocated_bytes();
    for (int i = 0; i < 100; ++i) {
        run_small_graph(*device);
        ASSERT_EQ(device->allocated_bytes(), start) << "cycle " << i;
    }
}

TEST(runtime_device, copies_through_staging_whatever_the_size_and_place)
{
    const auto device = make_device({.limits = "staging=1"});
    const size_t size = (33u << 20) + 13; // more than two stagings, and odd
    const auto buffer = make_buffer(*device, size);
    ASSERT_EQ(buffer->mapped(), nullptr);
    const Bytes written = pattern(size);
    ASSERT_TRUE(device->write(buffer->slice(), written));
    Bytes read(size);
    ASSERT_TRUE(device->read(buffer->slice(), read));
    ASSERT_TRUE(read == written);
    for (auto [at, count] :
         {std::array<size_t, 2>{7, 1}, {12345, 777}, {(16u << 20) - 3, 17u << 20}, {size - 1, 1}, {9, 0}}) {
        Bytes part(count);
        ASSERT_TRUE(device->read(buffer->slice().part(at, count), part));
        EXPECT_TRUE(std::equal(part.begin(), part.end(), written.begin() + long(at))) << at;
    }
}

TEST(runtime_device, clears_the_bytes_that_it_is_told_and_no_others)
{
    for (const char* limits : {"", "staging=1"}) {
        const auto device = make_device({.limits = limits});
        const auto buffer = make_buffer(*device, 70000);
        for (auto [at, count] :
             {std::array<size_t, 2>{0, 70000}, {1, 1}, {3, 2}, {4, 4}, {5, 6}, {9, 60001}, {69997, 3}, {8, 0}}) {
            Bytes expected = pattern(70000), read(70000);
            ASSERT_TRUE(device->write(buffer->slice(), expected));
            const Status cleared = device->clear(buffer->slice().part(at, count));
            ASSERT_TRUE(cleared) << cleared.error().message;
            ASSERT_TRUE(device->read(buffer->slice(), read));
            std::fill_n(expected.begin() + long(at), count, std::byte(0));
            EXPECT_TRUE(read == expected) << limits << " " << at << " " << count;
        }
    }
}

TEST(runtime_device, runs_programs_over_memory_that_the_host_cannot_see)
{
    run_small_graph(*make_device({.limits = "staging=1"}));
}

TEST(runtime_device, writes_a_chrome_trace_of_every_pass)
{
    const auto device = make_device();
    const auto profile = std::make_shared<Profile>();
    device->set_profile(profile);
    run_small_graph(*device);
    run_small_graph(*device);
    const ScratchFolder folder;
    ASSERT_TRUE(profile->write(folder / "trace.json"));
    const nlohmann::json trace = json_of(contents(folder / "trace.json"));
    ASSERT_EQ(trace.at("traceEvents").size(), 6u);
    double last = 0;
    for (const auto& event : trace.at("traceEvents")) {
        EXPECT_EQ(event.at("ph"), "X");
        EXPECT_GE(event.at("dur").get<double>(), 0);
        EXPECT_GE(event.at("ts").get<double>(), last);
        last = event.at("ts");
    }
    EXPECT_EQ(trace.at("traceEvents")[1].at("name"), "activation");
    EXPECT_NE(profile->summary().find("activation"), std::string::npos);
    EXPECT_TRUE(says(profile->write(folder / "no" / "folder"), "cannot write"));
}

// the lines that --profile prints of kernels; empty where the driver says nothing of its code
std::string statistics_of_a_run(bool wanted)
{
    DeviceOptions options;
    options.pipeline_statistics = wanted;
    const auto device = make_device(options);
    const auto profile = std::make_shared<Profile>();
    device->set_profile(profile);
    run_small_graph(*device);
    return profile->statistics();
}

TEST(runtime_device, tells_what_its_driver_says_of_pipelines_only_where_that_is_wanted)
{
    const auto device = make_device();
    const auto devices = list_devices();
    ASSERT_TRUE(devices) << devices.error().message;
    const auto& extensions = devices->at(device->index()).extensions;
    const bool driver_does =
        std::ranges::count(extensions, std::string(VK_KHR_PIPELINE_EXECUTABLE_PROPERTIES_EXTENSION_NAME)) > 0;
    const std::string told = statistics_of_a_run(true);
    EXPECT_EQ(told.find("activation") != std::string::npos, driver_does) << told;
    EXPECT_EQ(told.find("Subgroup size") != std::string::npos, driver_does) << told;
    EXPECT_EQ(statistics_of_a_run(false), "");
}

size_t reused_by_a_run()
{
    const auto device = make_device();
    const size_t reused = device->pipelines().reused_bytes();
    run_small_graph(*device);
    return reused;
}

TEST(runtime_device, keeps_its_pipelines_in_a_file_and_starts_with_them)
{
    const CacheHome home;
    EXPECT_EQ(reused_by_a_run(), 0u);
    ASSERT_FALSE(home.file().empty());
    const uint64_t bytes = std::filesystem::file_size(home.file());
    EXPECT_EQ(reused_by_a_run(), bytes - 16); // after the checksum, and no tiles
}

TEST(runtime_device, saves_its_pipelines_while_it_runs)
{
    const CacheHome home;
    const auto device = make_device();
    run_small_graph(*device);
    EXPECT_GT(std::filesystem::file_size(home.file()), 8u); // what a run leaves that is killed now
}

TEST(runtime_device, ignores_a_damaged_pipeline_cache_and_writes_a_good_one)
{
    const CacheHome home;
    (void)reused_by_a_run();
    const std::string good = contents(home.file());
    std::string flipped = good, foreign = good;
    flipped.back() ^= 1;
    for (const std::string& bad :
         {std::string(), std::string("x"), good.substr(0, good.size() - 1), flipped, good + "y"}) {
        std::ofstream(home.file(), std::ios::binary | std::ios::trunc) << bad;
        EXPECT_EQ(reused_by_a_run(), 0u) << bad.size();
        EXPECT_GT(reused_by_a_run(), 0u);
    }
}

TEST(runtime_device, runs_without_a_place_for_its_cache)
{
    const CacheHome home;
    setenv("XDG_CACHE_HOME", "/proc/nowhere", 1);
    EXPECT_EQ(reused_by_a_run(), 0u);
}

ExternalDevice external_of(const HostVulkan& vulkan)
{
    ExternalDevice external;
    external.instance = vulkan.instance;
    external.physical = vulkan.physical;
    external.device = vulkan.device;
    external.queue = vulkan.queue;
    external.robust_buffer_access = true;
    external.float16 = external.cooperative_matrix = vulkan.has_matrices;
    return external;
}

TEST(runtime_device, keeps_no_file_for_a_device_of_the_host_and_starts_with_what_the_host_kept)
{
    const CacheHome home;
    HostVulkan vulkan;
    std::vector<char> blob;
    {
        const auto device = Device::adopt(external_of(vulkan), {});
        ASSERT_TRUE(device) << device.error().message;
        EXPECT_TRUE((*device)->pipelines().file().empty());
        run_small_graph(**device);
        blob = *(*device)->pipelines().blob();
    }
    const auto reused = [&](const std::vector<char>& given) {
        const auto device = Device::adopt(external_of(vulkan), {.pipeline_cache = std::as_bytes(std::span(given))});
        return (*device)->pipelines().reused_bytes();
    };
    EXPECT_EQ(reused(blob), blob.size() - 16); // checksum, no tiles
    for (const size_t bytes : {size_t(1), size_t(8), blob.size() - 1})
        EXPECT_EQ(reused({blob.begin(), blob.begin() + long(bytes)}), 0u) << bytes;
    std::vector<char> flipped = blob;
    flipped.back() ^= 1;
    EXPECT_EQ(reused(flipped), 0u);
    // in place of the file of a device of our own, too
    const auto own = Device::create({.pipeline_cache = std::as_bytes(std::span(blob))});
    ASSERT_TRUE(own) << own.error().message;
    EXPECT_EQ((*own)->pipelines().reused_bytes(), blob.size() - 16); // checksum, no tiles
    run_small_graph(**own);
    EXPECT_FALSE(std::filesystem::exists(home.folder()));
    EXPECT_EQ(vulkan.messages, 0);
}

TEST(runtime_device, reads_no_variable_for_a_device_of_the_host)
{
    HostVulkan vulkan;
    const char* before = std::getenv("SEMROVER_LIMITS");
    const std::string limits = before ? before : "";
    setenv("SEMROVER_LIMITS", "colour=1", 1);
    EXPECT_TRUE(Device::adopt(external_of(vulkan), {}));
    EXPECT_TRUE(says(Device::create({}), "unknown limit 'colour'"));
    before ? setenv("SEMROVER_LIMITS", limits.c_str(), 1) : unsetenv("SEMROVER_LIMITS");
}

TEST(runtime_device, works_on_a_device_that_the_host_made_and_leaves_it)
{
    HostVulkan vulkan;
    int locks = 0, unlocks = 0;
    ExternalDevice external = external_of(vulkan);
    external.lock = [&] {
        EXPECT_EQ(locks, unlocks);
        ++locks;
    };
    external.unlock = [&] { ++unlocks; };
    for (int i = 0; i < 3; ++i) {
        auto device = Device::adopt(external, {.limits = "staging=1"});
        ASSERT_TRUE(device) << device.error().message;
        EXPECT_EQ((*device)->handle(), vulkan.device);
        EXPECT_EQ((*device)->limits().features & kFeatureFloat16, 0u); // the host has not enabled it
        run_small_graph(**device);
        EXPECT_EQ(locks, 3 * (i + 1)); // a write, a run, a read
        EXPECT_EQ(unlocks, locks);
    }
    EXPECT_EQ(vkQueueWaitIdle(vulkan.queue), VK_SUCCESS);
    EXPECT_EQ(vulkan.messages, 0);
}

// multiplies fp16 matrices of ones; -> by which variant
std::string run_half_gemm(Device& device)
{
    const uint32_t size = 64;
    const auto x = make_buffer(device, size * size * 2), y = make_buffer(device, size * size * 4);
    const std::vector<uint16_t> ones(size * size, 0x3c00);
    EXPECT_TRUE(device.write(x->slice(), std::as_bytes(std::span(ones))));
    Graph g(device.limits());
    const Tensor a = g.external(x->slice(), size, size, DType::f16, "x");
    g.keep(gemm(g, a, a, {}, {.dtype = DType::f32}), g.external(y->slice(), size, size, DType::f32, "y"));
    auto executable = Executable::create(device, g);
    SR_ASSERT(bool(executable), "{}", executable.error().message);
    EXPECT_TRUE((*executable)->run());
    std::vector<float> got(size * size);
    EXPECT_TRUE(device.read(y->slice(), std::as_writable_bytes(std::span(got))));
    EXPECT_EQ(got, std::vector<float>(size * size, float(size)));
    return std::string((*executable)->plan().passes[0].variant->name);
}

// what the hardware has, and the host has enabled and says so
TEST(runtime_device, uses_matrix_units_of_a_host_device_where_the_host_enabled_them)
{
    const bool has = make_device()->limits().features & kFeatureCooperativeMatrix;
    HostVulkan with(true), without;
    EXPECT_EQ(with.has_matrices, has);
    for (const HostVulkan* vulkan : {&with, &without}) {
        const auto device = Device::adopt(external_of(*vulkan), {.limits = "variant=coopmat"});
        ASSERT_TRUE(device) << device.error().message;
        EXPECT_EQ(run_half_gemm(**device) == "coopmat", vulkan->has_matrices);
        EXPECT_EQ(vulkan->messages, 0);
    }
}

TEST(runtime_device, refuses_a_host_device_that_lacks_something)
{
    HostVulkan vulkan;
    const ExternalDevice whole = external_of(vulkan);
    ExternalDevice external = whole;
    external.queue = VK_NULL_HANDLE;
    EXPECT_TRUE(says(Device::adopt(external, {}),
                     "a device of the application's needs instance, physical device, device and queue"));
    external = whole;
    external.queue_family = 77;
    EXPECT_TRUE(says(Device::adopt(external, {}), "queue family 77 of the application's device has no compute"));
    external = whole;
    external.robust_buffer_access = false;
    EXPECT_TRUE(says(Device::adopt(external, {}),
                     "a device of the application's needs robustBufferAccess or pipelineRobustness"));
    external = whole;
    external.cooperative_matrix = true;
    EXPECT_TRUE(says(Device::adopt(external, {}), "with cooperative matrices needs shaderFloat16"));
    external = whole;
    external.lock = [] {};
    EXPECT_TRUE(says(Device::adopt(external, {}), "needs both of lock and unlock, or neither"));
    EXPECT_TRUE(says(Device::adopt(whole, {.limits = "colour=1"}), "unknown limit 'colour'"));
    EXPECT_EQ(vulkan.messages, 0);
}

} // namespace runtime_device_test
} // namespace semrover
