// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/splat/rasterizer.h"

#include "engine/splat/planes.h"
#include "runtime/device/command.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace semrover {

namespace {

constexpr uint32_t kPairBytes = 4;
constexpr const char* kImageNames[] = {"splat colour", "splat surface", "splat depth", "splat ids", "splat owners"};

Status check_camera(const SplatCamera& c, size_t index)
{
    bool finite = std::isfinite(c.fx) && std::isfinite(c.fy) && std::isfinite(c.cx) && std::isfinite(c.cy);
    for (float v : c.world_to_camera)
        finite = finite && std::isfinite(v);
    for (float v : c.distortion)
        finite = finite && std::isfinite(v);
    if (!finite || c.fx == 0 || c.fy == 0)
        return fail(ErrorCode::bad_input, "camera {}: {}", index,
                    finite ? "no focal length" : "a number is not finite");
    return {};
}

// room for `need` and a quarter more, if the device can bind it
Result<uint32_t> room_for(uint32_t need, uint32_t bytes_each, const DeviceLimits& limits, const char* what)
{
    const uint64_t limit = std::min(limits.max_storage_range, limits.max_allocation) / bytes_each;
    if (need > limit)
        return fail(ErrorCode::out_of_memory, "a frame needs {} {}; this device has room for {}", need, what, limit);
    return uint32_t(std::min<uint64_t>(limit, uint64_t(need) + need / 4 + 1024));
}

// Rows that are looked at in a scene of `most` with `rows` in use: 1, 2, 3, 4, 6, 8, 12 .. times 4096, so that a
// rasterizer of one that grows is seldom made anew.
uint32_t stepped(uint32_t rows, uint32_t most)
{
    const uint64_t step = std::max(std::bit_floor(std::max(rows, 1u)) / 2, 4096u);
    return uint32_t(std::min(round_up64(std::max(rows, 1u), step), uint64_t(most)));
}

// some texels of what SplatSlots has, in that order
void take_apart(const ReadPiece& piece, size_t pictures, SplatImage& image, float visible_alpha)
{
    if (piece.bytes.empty())
        return;
    const size_t which = piece.slice % pictures, first = piece.at / (which < 2 ? 16 : which < 4 ? 8 : 4);
    const std::span numbers(reinterpret_cast<const float*>(piece.bytes.data()), piece.bytes.size() / sizeof(float));
    const std::span words(reinterpret_cast<const uint32_t*>(piece.bytes.data()), numbers.size());
    switch (which) {
    case 0:
        split_texels(numbers, &image.color[first * 3], &image.alpha[first]);
        mark_from(std::span(image.alpha).subspan(first, numbers.size() / 4), visible_alpha, &image.visible[first]);
        break;
    case 1:
        split_texels(numbers, &image.normal[first * 3], &image.depth_sum[first]);
        break;
    case 2:
        split_pairs(numbers, &image.depth_expected[first], &image.depth_median[first]);
        break;
    case 3:
        split_pairs(words, &image.label[first], &image.cell[first]);
        break;
    default:
        std::ranges::copy(words, image.owner.begin() + ptrdiff_t(first));
    }
}

} // namespace

SplatLens lens_of(CameraModel model)
{
    switch (model) {
    case CameraModel::opencv:
        return SplatLens::opencv;
    case CameraModel::fisheye:
        return SplatLens::fisheye;
    case CameraModel::equirectangular:
        return SplatLens::equirectangular;
    case CameraModel::ftheta:
        return SplatLens::ftheta;
    case CameraModel::pinhole:
        break;
    }
    return SplatLens::pinhole;
}

void write_row(const SplatCamera& c, std::span<float> row)
{
    const float focal[] = {c.fx, c.fy, c.cx, c.cy};
    std::copy_n(focal, 4, row.begin());
    std::copy_n(c.world_to_camera.data(), 12, row.begin() + 4);
    if (row.size() == 16)
        return;
    std::copy_n(c.distortion.data(), 12, row.begin() + 16);
    const float rest[] = {c.limit,   float(c.radial_depth), c.first,    c.reach,    c.turn[0],  c.turn[1],
                          c.turn[2], c.across[0],           c.shift[0], c.shift[1], c.shift[2], c.across[1]};
    std::ranges::copy(rest, row.begin() + 28);
}

SplatCamera splat_camera(const Intrinsics& i, const Pose& pose)
{
    SplatCamera c{float(i.fx), float(i.fy), float(i.cx), float(i.cy)};
    const auto narrowed = [](double v) { return float(v); };
    std::transform(pose.world_to_camera.begin(), pose.world_to_camera.begin() + 12, c.world_to_camera.begin(),
                   narrowed);
    if (i.model != CameraModel::pinhole) {
        const Lens lens(i);
        std::ranges::transform(i.distortion, c.distortion.begin(), narrowed);
        c.limit = float(lens.limit());
        c.reach = float(lens.reach());
        c.radial_depth = lens.radial_depth();
    }
    return c;
}

CameraModel drawn_model(CameraModel model, bool moving)
{
    return moving && model == CameraModel::pinhole ? CameraModel::opencv : model;
}

SplatCamera splat_camera(const CameraFrame& frame, bool moving)
{
    Intrinsics i = frame.intrinsics;
    i.model = drawn_model(i.model, moving);
    const CameraMotion motion = motion_of(frame);
    SplatCamera c = splat_camera(i, motion.middle);
    const auto narrowed = [](double v) { return float(v); };
    std::ranges::transform(motion.turn, c.turn.begin(), narrowed);
    std::ranges::transform(motion.shift, c.shift.begin(), narrowed);
    std::ranges::transform(motion.across, c.across.begin(), narrowed);
    c.first = float(motion.first);
    return c;
}

std::array<std::array<float, 12>, 2> moving_views(const CameraMotion& camera, const Rigid& from, const Rigid& to,
                                                  const Rigid& from_splats)
{
    const ThingMotion motion = motion_of(camera, from, to);
    const Rigid view = compose(motion.view, from_splats);
    std::array<std::array<float, 12>, 2> rows{};
    const auto narrowed = [](double v) { return float(v); };
    std::transform(view.begin(), view.begin() + 12, rows[0].begin(), narrowed);
    std::ranges::transform(motion.turn, rows[1].begin(), narrowed);
    std::ranges::transform(motion.shift, rows[1].begin() + 4, narrowed);
    std::ranges::transform(motion.pivot, rows[1].begin() + 8, narrowed);
    return rows;
}

Result<std::unique_ptr<Rasterizer>> Rasterizer::create(Device& device, const SplatScene& scene, uint32_t width,
                                                       uint32_t height, uint32_t max_cameras,
                                                       const RasterizerOptions& options)
{
    if (width < 1 || height < 1 || width > 65535 || height > 65535)
        return fail(ErrorCode::usage, "an image of {} x {} pixels; 1 to 65535 are supported", width, height);
    SR_ASSERT(options.sweep_rows.empty() || options.sweep_rows.size() == height, "{} rows of a sweep in {}",
              options.sweep_rows.size(), height);
    if (max_cameras < 1 || options.tile < 16 || options.tile % 16)
        return fail(ErrorCode::usage, "{} cameras, tiles of {} pixels", max_cameras, options.tile);
    std::unique_ptr<Rasterizer> r(new Rasterizer(device, scene));
    r->options_ = options;
    r->width_ = width;
    r->height_ = height;
    const uint32_t rows = r->rows_ = options.rows ? stepped(*options.rows, scene.size()) : scene.size();
    const uint64_t limit = std::min(device.limits().max_storage_range, device.limits().max_allocation);
    const uint64_t per_camera =
        std::max(uint64_t(width) * height * 16, uint64_t(rows) * 4); // bytes of the largest tensor
    if (per_camera > limit)
        return fail(ErrorCode::out_of_memory,
                    "{} x {} pixels of {} splats need {} bytes in one tensor; this device takes {}", width, height,
                    rows, per_camera, limit);
    r->cameras_ = uint32_t(std::min<uint64_t>(max_cameras, limit / per_camera));
    r->max_visible_ =
        uint32_t(std::min<uint64_t>(std::max(rows, 1024u), limit / splat_record_bytes(r->lens(), options.moving)));
    // A street of a million splats has 1.5 pairs a splat at 616 x 424 and 2.8 at 1920 x 1080. More room makes the
    // blending seem longer than a submit may last, and then it is cut.
    const uint64_t pairs = options.max_pairs ? options.max_pairs : std::max<uint64_t>(4ull * rows, 65536);
    r->max_pairs_ = uint32_t(std::min(pairs, limit / kPairBytes));
    SR_CHECK(r->build());
    return r;
}

SplatLens Rasterizer::lens() const
{
    return options_.sweep_rows.empty() ? lens_of(options_.model) : SplatLens::spinning;
}

Status Rasterizer::build()
{
    executable_.reset();
    state_ = TensorPool();
    const uint32_t pixels = width_ * height_ * cameras_;
    const uint32_t camera_floats = splat_camera_floats(lens());
    camera_table_ = state_.tensor(cameras_, camera_floats, DType::f32, "cameras", camera_floats);
    visible_ = state_.tensor(1, 1, DType::u32, "visible splats", 1);
    pairs_ = state_.tensor(1, 1, DType::u32, "splat pairs", 1);
    if (!options_.sweep_rows.empty())
        sweep_rows_ = state_.tensor(height_, 4, DType::f32, "rows of a sweep", 4);
    if (options_.depth_tested) {
        z_buffer_ = state_.tensor(pixels, 1, DType::f32, "z-buffer", 1);
        z_scale_ = state_.tensor(1, 2, DType::f32, "scale of the z-buffer", 2);
    }
    if (options_.movers) {
        movers_ = state_.tensor(cameras_ * views_of_movers(), 12, DType::f32, "views of movers", 12);
        mover_rows_ = state_.tensor(options_.mover_numbers, 1, DType::u32, "rows of movers", 1);
    }
    if (options_.pixels_over)
        pixels_ = {state_.tensor(pixels, 1, DType::u32, "seen", 1), state_.tensor(pixels, 1, DType::u32, "depths", 1),
                   state_.tensor(pixels, 1, DType::u32, "normals", 1),
                   options_.instances ? state_.tensor(pixels, 1, DType::u32, "instances", 1) : DeviceTensor()};
    else
        declare_images(pixels);
    SR_CHECK(state_.allocate(device_, "splat images"));
    if (sweep_rows_.valid())
        SR_CHECK(sweep_rows_.write(device_, options_.sweep_rows));
    Graph g(device_.limits());
    SplatOptions o{.width = width_,
                   .height = height_,
                   .lens = lens(),
                   .moving = options_.moving,
                   .max_visible = max_visible_,
                   .max_pairs = max_pairs_,
                   .tile = options_.tile};
    o.near = options_.near;
    o.alpha_min = options_.alpha_min;
    o.alpha_max = options_.alpha_max;
    o.transmittance_min = options_.transmittance_min;
    o.screen_variance = options_.screen_variance;
    o.cutoff = options_.cutoff;
    if (options_.depth_tested)
        o.limits = splat_limits(g, z_buffer_.in(g), z_scale_.in(g));
    if (sweep_rows_.valid())
        o.rows = sweep_rows_.in(g);
    if (options_.movers) {
        o.movers = movers_.in(g);
        o.mover_rows = mover_rows_.in(g);
    }
    for (size_t i = 0; i < o.made.size(); ++i)
        o.made[i] = options_.pixels_over ? i < 4 || options_.instances : options_.formats[i].texels != Texels::none;
    const SplatImages y = splat(g, scene_.in(g, rows_), camera_table_.in(g), o);
    options_.pixels_over ? keep_pixels(g, y) : keep_images(g, y);
    g.keep(y.visible, visible_);
    g.keep(y.pairs, pairs_);
    SR_TRY(executable_, Executable::create(device_, g));
    return {};
}

// slots of what is wanted
void Rasterizer::declare_images(uint32_t pixels)
{
    const auto slots = images_.all();
    for (size_t i = 0; i < slots.size(); ++i) {
        const auto& [texels, linear, scaled] = options_.formats[i];
        const uint32_t numbers = i < 2 ? 4 : i < 4 ? 2 : 1;
        if (texels == Texels::none)
            *slots[i] = {};
        else if (texels == Texels::whole)
            *slots[i] = state_.tensor(pixels, numbers, i >= 3 ? DType::u32 : DType::f32, kImageNames[i], numbers);
        else
            *slots[i] =
                state_.tensor(texel_words(texels, width_ * height_) * cameras_, 1, DType::u32, kImageNames[i], 1);
        if (scaled)
            format_scale_ = state_.tensor(1, 2, DType::f32, "scale of a picture", 2);
    }
}

void Rasterizer::keep_pixels(Graph& g, const SplatImages& y)
{
    const PixelWords made = splat_pixels(g, y, {*options_.pixels_over, options_.visible_alpha, options_.depth_units});
    g.keep(made.seen, pixels_.seen);
    g.keep(made.depths, pixels_.depths);
    g.keep(made.normals, pixels_.normals);
    if (options_.instances)
        g.keep(y.owners, pixels_.instances);
}

void Rasterizer::keep_images(Graph& g, const SplatImages& y)
{
    const auto slots = images_.all();
    const std::array<Tensor, 5> made = {y.color, y.surface, y.depth, y.ids, y.owners};
    for (size_t i = 0; i < slots.size(); ++i) {
        const PictureFormat& format = options_.formats[i];
        if (format.texels == Texels::none)
            continue;
        const bool whole = format.texels == Texels::whole;
        const Tensor scale = format.scaled ? format_scale_.in(g) : Tensor{};
        g.keep(whole ? made[i] : splat_texels(g, made[i], cameras_, format, scale), *slots[i]);
    }
}

Status Rasterizer::make_room(uint32_t visible, uint32_t pairs)
{
    if (visible > max_visible_) {
        SR_TRY(max_visible_,
               room_for(visible, splat_record_bytes(lens(), options_.moving), device_.limits(), "visible splats"));
    }
    if (pairs > max_pairs_) {
        SR_TRY(max_pairs_, room_for(pairs, kPairBytes, device_.limits(), "pairs of splat and tile"));
    }
    ++rebuilds_;
    return build();
}

// the tables of movers: of `cameras` ones from the first on; those that are left see none
Rasterizer::MoverTables Rasterizer::tables_of(const SplatMovers& movers, size_t first, size_t cameras) const
{
    const size_t each = movers.count * (options_.moving ? 2 : 1);
    MoverTables tables{movers.rows, {}};
    SR_ASSERT(each <= views_of_movers() && movers.rows.size() <= options_.mover_numbers &&
                  movers.views.size() >= (first + cameras) * each,
              "{} movers with numbers below {}; this rasterizer has room for {} and {}", each, movers.rows.size(),
              options_.movers, options_.mover_numbers);
    tables.rows.resize(options_.mover_numbers);
    tables.views.resize(size_t(cameras_) * views_of_movers());
    for (size_t camera = 0; camera < cameras; ++camera)
        std::copy_n(movers.views.begin() + ptrdiff_t((first + camera) * each), each,
                    tables.views.begin() + ptrdiff_t(camera * views_of_movers()));
    return tables;
}

// the frames of at most cameras_ cameras, the first of which is number `first` of those with movers
Status Rasterizer::draw_together(std::span<const SplatCamera> cameras, const SplatMovers& movers, size_t first)
{
    const uint32_t floats = splat_camera_floats(lens());
    std::vector<float> table(size_t(cameras_) * floats);
    for (size_t i = 0; i < cameras.size(); ++i)
        write_row(cameras[i], std::span(table).subspan(i * floats, floats));
    if (!executable_) // there was no memory for it the last time
        SR_CHECK(build());
    for (;;) {
        SR_CHECK(camera_table_.write(device_, table));
        if (options_.movers) {
            const MoverTables tables = tables_of(movers, first, cameras.size());
            SR_CHECK(mover_rows_.write(device_, tables.rows));
            SR_CHECK(movers_.write(device_, tables.views));
        }
        SR_CHECK(executable_->run());
        const BufferSlice slices[] = {visible_.slice(), pairs_.slice()};
        uint32_t counts[2] = {};
        SR_CHECK(device_.read(slices, [&](const ReadPiece& piece) {
            std::memcpy(&counts[piece.slice], piece.bytes.data(), sizeof(uint32_t));
        }));
        const auto [visible, pairs] = counts;
        if (visible <= max_visible_ && pairs <= max_pairs_)
            return {};
        SR_CHECK(make_room(visible, pairs)); // pairs of what was visible; with more room there may be more
    }
}

Status Rasterizer::record(VkCommandBuffer commands, const SplatCamera& camera, std::array<float, 2> z_scale,
                          std::array<float, 2> format_scale, const SplatMovers& movers)
{
    SR_CHECK(check_camera(camera, 0));
    if (!executable_) // there was no memory for it the last time
        SR_CHECK(build());
    if (!recorded_) {
        SR_TRY(recorded_, Buffer::create(device_, kRecordings * sizeof(uint32_t), MemoryKind::staging, "counts"));
        std::memset(recorded_->mapped(), 0, kRecordings * sizeof(uint32_t));
    }
    std::vector<float> table(size_t(cameras_) * splat_camera_floats(lens()));
    write_row(camera, std::span(table).first(table.size() / cameras_));
    const VulkanCalls& vk = device_.vk();
    const BufferSlice cameras = camera_table_.slice();
    record_entry_barrier(vk, commands);
    record_update(vk, commands, cameras.buffer->handle(), cameras.offset, std::as_bytes(std::span(table)));
    for (const auto& [slot, numbers] : {std::pair{&z_scale_, &z_scale}, {&format_scale_, &format_scale}}) {
        if (!slot->valid())
            continue;
        const BufferSlice scale = slot->slice();
        record_update(vk, commands, scale.buffer->handle(), scale.offset, std::as_bytes(std::span(*numbers)));
    }
    if (options_.movers) {
        const MoverTables tables = tables_of(movers, 0, 1);
        const BufferSlice rows = mover_rows_.slice(), views = movers_.slice();
        record_update(vk, commands, rows.buffer->handle(), rows.offset, std::as_bytes(std::span(tables.rows)));
        record_update(vk, commands, views.buffer->handle(), views.offset, std::as_bytes(std::span(tables.views)));
    }
    executable_->record_into(commands);
    const BufferSlice pairs = pairs_.slice();
    const uint64_t at = recording_++ % kRecordings * sizeof(uint32_t);
    record_copy(vk, commands, pairs.buffer->handle(), pairs.offset, recorded_->handle(), at, sizeof(uint32_t));
    return {};
}

uint32_t Rasterizer::recorded_pairs() const
{
    uint32_t most = 0;
    for (uint32_t i = 0; recorded_ && i < kRecordings; ++i) {
        // the device may write it at this moment
        const auto* pairs = reinterpret_cast<const volatile uint32_t*>(recorded_->mapped()) + i;
        most = std::max(most, uint32_t(*pairs));
    }
    return most;
}

Result<uint32_t> Rasterizer::draw_some(std::span<const SplatCamera> cameras, const SplatMovers& movers, size_t first)
{
    for (;;) {
        const auto some = cameras.first(std::min<size_t>(cameras_, cameras.size()));
        const Status status = draw_together(some, movers, first);
        if (status)
            return uint32_t(some.size());
        if (status.error().code != ErrorCode::out_of_memory || some.size() == 1)
            return tl::make_unexpected(status.error());
        cameras_ = uint32_t(some.size() + 1) / 2; // together they are too many for this device
        ++rebuilds_;
        SR_CHECK(build());
    }
}

Result<uint32_t> Rasterizer::draw(std::span<const SplatCamera> cameras, const SplatMovers& movers)
{
    SR_ASSERT(!cameras.empty(), "no camera to draw");
    for (size_t i = 0; i < cameras.size(); ++i)
        SR_CHECK(check_camera(cameras[i], i));
    return draw_some(cameras, movers, 0);
}

SplatPixelSlots Rasterizer::pixels(uint32_t camera) const
{
    const uint32_t pixels = width_ * height_, first = camera * pixels;
    return {pixels_.seen.row_range(first, pixels), pixels_.depths.row_range(first, pixels),
            pixels_.normals.row_range(first, pixels),
            options_.instances ? pixels_.instances.row_range(first, pixels) : DeviceTensor()};
}

SplatSlots Rasterizer::images(uint32_t camera) const
{
    SplatSlots of_camera = images_;
    for (DeviceTensor* slot : of_camera.all())
        if (slot->valid())
            *slot = slot->row_range(camera * (slot->rows() / cameras_), slot->rows() / cameras_);
    return of_camera;
}

Status Rasterizer::read_images(std::span<SplatImage> images)
{
    const size_t pixels = size_t(width_) * height_;
    std::vector<BufferSlice> slices; // as many a camera
    const bool owners = images_.owners.valid();
    for (uint32_t camera = 0; camera < images.size(); ++camera) {
        SplatImage& image = images[camera];
        image.width = width_;
        image.height = height_;
        image.color.resize(pixels * 3);
        image.normal.resize(pixels * 3);
        for (auto* plane : {&image.alpha, &image.depth_sum, &image.depth_expected, &image.depth_median})
            plane->resize(pixels);
        image.label.resize(pixels);
        image.cell.resize(pixels);
        image.visible.resize(pixels);
        image.owner.resize(owners ? pixels : 0);
        SplatSlots slots = this->images(camera);
        for (const DeviceTensor* slot : slots.all())
            if (slot->valid())
                slices.push_back(slot->slice());
    }
    const size_t pictures = owners ? 5 : 4;
    return device_.read(slices, [&](const ReadPiece& piece) {
        take_apart(piece, pictures, images[piece.slice / pictures], options_.visible_alpha);
    });
}

Status Rasterizer::render(std::span<const SplatCamera> cameras, std::vector<SplatImage>& images,
                          const SplatMovers& movers)
{
    const auto whole = [](const PictureFormat& format) { return format == PictureFormat(); };
    SR_ASSERT(!options_.pixels_over && std::all_of(options_.formats.begin(), options_.formats.begin() + 4, whole),
              "this rasterizer does not keep whole images");
    for (size_t i = 0; i < cameras.size(); ++i)
        SR_CHECK(check_camera(cameras[i], i));
    images.resize(cameras.size());
    for (size_t done = 0; done < cameras.size();) {
        SR_TRY(const uint32_t drawn, draw_some(cameras.subspan(done), movers, done));
        SR_CHECK(read_images(std::span(images).subspan(done, drawn)));
        done += drawn;
    }
    return {};
}

Result<std::vector<SplatImage>> Rasterizer::render(std::span<const SplatCamera> cameras, const SplatMovers& movers)
{
    std::vector<SplatImage> images;
    SR_CHECK(render(cameras, images, movers));
    return images;
}

} // namespace semrover
