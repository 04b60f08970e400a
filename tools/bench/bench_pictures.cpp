// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover bench pictures: what the cameras of a rig see at one time, from pixels to files
#include "engine/deferred/frame_images.h"
#include "engine/job/file_queue.h"
#include "engine/splat/rasterizer.h"
#include "runtime/base/unfinished.h"
#include "tools/bench/bench.h"
#include "tools/cli/open_device.h"
#include "tools/cli/picture_options.h"
#include "tools/cli/value_options.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <numbers>

namespace semrover {

namespace {

constexpr uint32_t kMoments = 4; // of a run: threads wait for each other at its end only
constexpr uint32_t kSplats = 200000;
constexpr float kSigma = 0.04f;

struct PicturesBenchOptions {
    uint32_t cameras = 6, width = 616, height = 424, threads = 0;
    PictureEncoding encoding;
};

class TemporaryFolder {
  public:
    TemporaryFolder()
        : path_(std::filesystem::temp_directory_path() /
                fmt::format(".semrover-{}-bench.tmp", system::process_number())),
          unfinished_(path_)
    {
    }
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;
    ~TemporaryFolder()
    {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    const Path& path() const { return path_; }

  private:
    Path path_;
    Unfinished unfinished_;
};

// cameras that look around at one place of the street
SplatCamera look(uint32_t camera, const PicturesBenchOptions& o)
{
    const double turn = 2 * std::numbers::pi * camera / o.cameras, s = std::sin(turn), c = std::cos(turn);
    return splat_camera(pinhole_from_fov(73, o.width, o.height),
                        {{s, -c, 0, -20 * s, 0, 0, -1, 0, c, s, 0, -20 * c, 0, 0, 0, 1}});
}

Result<std::vector<FramePixels>> draw(Device& device, const PicturesBenchOptions& o)
{
    SR_TRY(const SplatScene scene, SplatScene::create(device, street_splats(kSplats, kSigma)));
    SR_TRY(const auto rasterizer,
           Rasterizer::create(device, scene, o.width, o.height, 1, {.pixels_over = std::array<uint8_t, 3>{}}));
    std::vector<FramePixels> pictures;
    for (uint32_t camera = 0; camera < o.cameras; ++camera) {
        const SplatCamera seen = look(camera, o);
        SR_CHECK(rasterizer->draw({&seen, 1}).map([](uint32_t) {}));
        const SplatPixelSlots slots = rasterizer->pixels(0);
        FramePixels& p = pictures.emplace_back(FramePixels{.width = o.width, .height = o.height});
        SR_TRY(p.seen, slots.seen.read<uint32_t>(device));
        SR_TRY(p.depths, slots.depths.read<uint32_t>(device));
        SR_TRY(p.normals, slots.normals.read<uint32_t>(device));
    }
    return pictures;
}

Status bench_pictures(const PicturesBenchOptions& o, const Globals& globals)
{
    SR_TRY(const auto device, open_device(globals, ""));
    SR_TRY(const std::vector<FramePixels> pictures, draw(*device, o));
    const TemporaryFolder folder;
    FileQueue queue(o.threads);
    const auto push = [&](uint32_t camera, uint32_t number) {
        return queue.push(pictures[camera].bytes(), [&, camera, number]() -> Result<FileQueue::Commit> {
            const auto files = std::make_shared<MadeFiles>();
            SR_CHECK(make_frame_images(folder.path() / fmt::format("{}", camera), number, pictures[camera], o.encoding,
                                       *files));
            return [files] { return files->commit(); };
        });
    };
    Result<Timing> timing = measure([&]() -> Status {
        for (uint32_t moment = 0; moment < kMoments; ++moment)
            for (uint32_t camera = 0; camera < o.cameras; ++camera)
                SR_CHECK(push(camera, moment));
        return queue.drain();
    });
    SR_CHECK(timing);
    timing->ms_median /= kMoments;
    timing->ms_min /= kMoments;
    Json report = bench_report("pictures", *device, DType::f32, *timing, 0);
    report.erase("predicted_bytes");
    report["cameras"] = o.cameras;
    report["threads"] = o.threads ? o.threads : usable_threads();
    report["width"] = o.width;
    report["height"] = o.height;
    report["format"] = o.encoding.color_extension();
    report["png_level"] = o.encoding.png_level;
    print_report(report, globals);
    return {};
}

} // namespace

void add_bench_pictures(CLI::App& bench, const Globals& globals, Run& run)
{
    auto o = std::make_shared<PicturesBenchOptions>();
    CLI::App* c = bench.add_subcommand("pictures", "files of what cameras see at one time, written to the folder of "
                                                   "temporary files; ms of a moment");
    add_number(*c, "--cameras", o->cameras, "of the rig", 1u, 64u);
    add_number(*c, "-W,--width", o->width, "pixels", 1u, 16384u);
    add_number(*c, "-H,--height", o->height, "pixels", 1u, 16384u);
    add_picture_options(*c, o->encoding, o->threads);
    c->callback([o, &globals, &run] { run = [o, &globals] { return bench_pictures(*o, globals); }; });
}

} // namespace semrover
