// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/view/viewer.h"

#include "runtime/base/file.h"
#include "runtime/base/quote.h"
#include "tools/cli/interrupt.h"
#include "tools/view/script.h"

#include <png.h>

namespace semrover::view {

namespace {

// r, g, b row by row from the top. The file appears whole or not at all; one that is there is replaced.
Status write_png(const Path& path, std::span<const uint8_t> rgb, uint32_t width, uint32_t height)
{
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = width;
    image.height = height;
    image.format = PNG_FORMAT_RGB;
    png_alloc_size_t bytes = PNG_IMAGE_PNG_SIZE_MAX(image);
    std::vector<std::byte> file(bytes);
    if (!png_image_write_to_memory(&image, file.data(), &bytes, 0, rgb.data(), 0, nullptr))
        return fail(ErrorCode::internal, "{}: libpng: {}", quote_path(path), image.message);
    return write_file_atomically(path, std::span<const std::byte>(file.data(), bytes));
}

constexpr double kBudgetAlone = 500; // milliseconds of a step where no window waits for it

} // namespace

Result<std::unique_ptr<Viewer>> Viewer::open(const ViewRequest& request)
{
    std::unique_ptr<Viewer> viewer(new Viewer(request));
    SR_CHECK(viewer->start());
    return viewer;
}

Viewer::~Viewer()
{
    if (window_)
        window_->detach();
}

Status Viewer::start()
{
    GpuRequest gpu{.device = request_.device, .max_bytes = request_.max_bytes, .make_surface = {}};
    if (request_.window) {
        SR_TRY(window_, Window::open(request_.width, request_.height));
        window_->ask(gpu);
    }
    SR_TRY(gpu_, Gpu::create(gpu));
    SR_TRY(shading_, Shading::create(*gpu_));
    SR_TRY(overlay_, Overlay::create(*gpu_, shading_->pass(), window_ ? window_->glfw() : nullptr));
    if (window_)
        SR_CHECK(window_->attach(*gpu_));
    SR_TRY(street_, Street::open(gpu_->context(), request_.street));
    refiner_ = std::make_unique<Refiner>(gpu_->context(), request_.refiner);
    SR_TRY(picture_, Picture::create(*gpu_, *shading_, request_.width, request_.height));
    window_size_ = size();

    camera = street_->start();
    camera.fov = request_.fov;
    camera.position = request_.position.value_or(camera.position);
    camera.yaw = request_.yaw.value_or(camera.yaw);
    camera.pitch = request_.pitch.value_or(camera.pitch);
    panels = request_.panels;
    budget_ms = request_.budget_ms;
    shown_ = before_refined_ = request_.shown;
    return {};
}

Status Viewer::run(Script& script)
{
    while (!quitting_ && !(window_ && window_->closing())) {
        if (interrupt_requested())
            return fail(ErrorCode::interrupted, "interrupted");
        const Stopwatch watch;
        SR_CHECK(frame(script));
        SR_CHECK(count_frame(watch.ms()));
    }
    return {};
}

// Without a window only pictures that somebody asks for are drawn.
Status Viewer::frame(Script& script)
{
    if (window_) {
        window_->poll();
        SR_CHECK(fit_window());
        overlay_->begin(picture_->width(), picture_->height());
        take_input(*this);
    }
    SR_CHECK(script.advance(*this));
    follow_recording();
    recorder.add(camera, seconds_);
    SR_CHECK(work());
    if (window_)
        SR_CHECK(draw());
    return write_wanted_picture();
}

// another size takes long to compile: only once the window has kept it for a while
Status Viewer::fit_window()
{
    const std::array<uint32_t, 2> now = window_->size();
    if (now != window_size_) {
        window_size_ = now;
        since_resize_ = {};
    }
    if (!now[0] || !now[1] || now == size() || since_resize_.ms() < 300)
        return {};
    refiner_->cancel();
    refined_there_ = false;
    if (shown_ == Shown::refined)
        shown_ = before_refined_;
    picture_.reset();
    SR_TRY(picture_, Picture::create(*gpu_, *shading_, now[0], now[1]));
    return {};
}

// the library's part of a frame
Status Viewer::work()
{
    const Stopwatch watch;
    const double ms = window_ ? budget_ms : std::max(budget_ms, kBudgetAlone);
    const auto budget = uint64_t(ms * 1000);
    if (camera != refined_camera_)
        refiner_->cancel();
    if (refiner_->busy()) { // the street waits, so that the frame is of the splats that were seen
        const Result<bool> done = refiner_->step(budget, *picture_);
        if (!done) {
            note(Status(tl::make_unexpected(done.error())));
            return window_ ? Status() : tl::make_unexpected(done.error());
        }
        if (*done) {
            refined_there_ = true;
            SR_CHECK(show(Shown::refined));
        }
    } else {
        SR_CHECK(grow(budget));
    }
    if (shown_ == Shown::refined && camera != refined_camera_) {
        refined_there_ = false;
        shown_ = before_refined_;
    }
    figures_.step.add(watch.ms());
    return {};
}

Status Viewer::grow(uint64_t budget_us)
{
    SR_CHECK(street_->focus(camera));
    SR_TRY(figures_.finished, street_->step(budget_us));
    if (!repick_ || !figures_.finished)
        return {};
    repick_ = false;
    if (picked_) {
        SR_TRY(picked_, pick(*street_, picked_->cell));
    }
    return {};
}

Look Viewer::look() const
{
    Look look;
    std::ranges::copy(camera.world_to_camera(), look.world_to_camera.begin());
    std::ranges::copy(camera.lens(picture_->width(), picture_->height()), look.lens.begin());
    look.shown = shown_;
    look.voxel = figures_.world.voxel_size > 0 ? float(figures_.world.voxel_size) : look.voxel;
    if (picked_) {
        look.brush = brush.reach;
        look.marked = {picked_->cell.i, picked_->cell.j, picked_->cell.k};
    }
    return look;
}

Status Viewer::draw()
{
    const Stopwatch watch;
    if (panels)
        draw_panels(*this);
    ImDrawData* shown_panels = overlay_->end();
    sr_draw_desc what{};
    what.struct_size = sizeof what;
    picture_->aim(what);
    camera.aim(what);
    for (int attempt = 0;; ++attempt) {
        SR_CHECK(draw_once(what, look(), panels ? shown_panels : nullptr));
        const sr_status whole = sr_world_check_draws(street_->world());
        if (whole == SR_ERR_PARTIAL && attempt < 8) // there is more room now
            continue;
        if (whole != SR_ERR_PARTIAL)
            SR_CHECK(checked(whole, gpu_->context()));
        break;
    }
    drawn_camera_ = camera;
    figures_.draw.add(watch.ms());
    return {};
}

// the picture as it would be in a window
Status Viewer::draw_alone()
{
    if (window_)
        return {};
    // a panel is laid out in the frame before the first that shows it
    overlay_->begin(picture_->width(), picture_->height());
    draw_panels(*this);
    overlay_->end();
    overlay_->begin(picture_->width(), picture_->height());
    return draw();
}

Status Viewer::draw_once(const sr_draw_desc& what, const Look& look, ImDrawData* shown_panels)
{
    const auto record = [&](VkCommandBuffer commands) -> Status {
        const sr_semaphore done = gpu_->next_run();
        SR_CHECK(checked(sr_world_record_updates(street_->world(), commands, &done), gpu_->context()));
        SR_CHECK(checked(sr_world_record(street_->world(), &what, commands), gpu_->context()));
        picture_->record(commands, look, shown_panels);
        return {};
    };
    return window_ ? window_->show(*picture_, record) : gpu_->run(record);
}

Status Viewer::write_wanted_picture()
{
    if (wanted_picture_.empty())
        return {};
    SR_CHECK(draw_alone());
    SR_TRY(const std::vector<uint8_t> rgb, picture_->read());
    const Path path = std::exchange(wanted_picture_, {});
    return write_png(path, rgb, picture_->width(), picture_->height());
}

Status Viewer::count_frame(double ms)
{
    ++figures_.frames;
    figures_.frame.add(ms);
    SR_TRY(figures_.world, street_->info());
    figures_.memory = {};
    figures_.memory.struct_size = sizeof figures_.memory;
    SR_CHECK(checked(sr_context_get_memory(gpu_->context(), &figures_.memory), gpu_->context()));
    // without somebody who looks, time goes by frames, so that a script gives the same path on any device
    frame_seconds_ = window_ ? ms / 1000 : 1.0 / 30;
    seconds_ += frame_seconds_;
    return {};
}

void Viewer::follow_recording()
{
    if (!playing_)
        return;
    if (*playing_ < recorder.size()) {
        camera = recorder.at((*playing_)++);
        return;
    }
    playing_.reset();
}

} // namespace semrover::view
