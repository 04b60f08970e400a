// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// GL contexts: pictures into textures, splats into buffer objects
#include "engine/capi/draws.h"
#include "engine/capi/exchange.h"
#include "engine/capi/gl_link.h"

using namespace semrover;
using namespace semrover::capi;

struct sr_gl {
    sr_context* context = nullptr;
    std::unique_ptr<GlLink> link;
    GlRoom pictures[4], frame;
    GlRoom splats[5];
    sr_gl_splats known = {};   // what the splats' rooms have
    uint64_t world_number = 0; // of which world; 0: of none yet

    ~sr_gl()
    {
        if (!link)
            return;
        for (GlRoom* room : rooms())
            link->drop(*room);
    }
    std::vector<GlRoom*> rooms()
    {
        std::vector<GlRoom*> all{&frame};
        for (GlRoom& room : pictures)
            all.push_back(&room);
        for (GlRoom& room : splats)
            all.push_back(&room);
        return all;
    }
};

namespace {

// calls f with the context of GL; an error is its sr_context's
template <Use use = kDraw, typename F>
sr_status with_gl(sr_gl* gl, const char* name, F f) noexcept
{
    return guarded<use>(gl ? gl->context : nullptr, [&]() -> Status {
        if (!gl)
            return fail(ErrorCode::usage, "{}: gl is NULL", name);
        return f();
    });
}

Result<std::unique_ptr<sr_gl>> make_gl(sr_context& context, const sr_gl_desc& d)
{
    if (!d.get_proc_address)
        return fail(ErrorCode::usage, "sr_gl_desc: get_proc_address is NULL");
    if (d.best > SR_GL_SHARED)
        return fail(ErrorCode::usage, "sr_gl_desc: best is {}, which is no sr_gl_way", d.best);
    auto gl = std::make_unique<sr_gl>();
    gl->context = &context;
    SR_TRY(gl->link, GlLink::create(*context.drawing, d.get_proc_address, sr_gl_way(d.best)));
    return gl;
}

sr_gl_info info_of(const sr_gl& gl)
{
    const GlLink& link = *gl.link;
    sr_gl_info info{};
    info.way = link.way();
    copy_text(info.reason, link.reason());
    info.es = link.gl().es;
    info.major = link.gl().major;
    info.minor = link.gl().minor;
    info.shared_bytes = link.shared_bytes();
    info.copied_bytes = link.copied_bytes();
    return info;
}

sr_draw_desc camera_of(const sr_gl_draw_desc& d)
{
    sr_draw_desc draw{};
    draw.struct_size = sizeof draw;
    draw.width = d.width;
    draw.height = d.height;
    draw.fx = d.fx;
    draw.fy = d.fy;
    draw.cx = d.cx;
    draw.cy = d.cy;
    std::copy_n(d.world_to_camera, 12, draw.world_to_camera);
    draw.time = d.time;
    return draw;
}

PictureFormats formats_of(const sr_gl_draw_desc& d)
{
    const auto format = [](GlName texture) { return PictureFormat{texture ? Texels::whole : Texels::none}; };
    return {format(d.color), format(d.normal), format(d.depth), format(d.label), {Texels::none}};
}

// a picture, the room that it goes through, and the texture that wants it
struct Wanted {
    DeviceTensor from;
    GlRoom* room;
    GlTexture texture;
    const char* what;
};

std::vector<Wanted> wanted_of(sr_gl& gl, const sr_gl_draw_desc& d, const SplatSlots& images)
{
    const Wanted all[] = {
        {images.color, &gl.pictures[0], {d.color, 0, 0, gl::kRgba, gl::kFloat}, "uploading color"},
        {images.surface, &gl.pictures[1], {d.normal, 0, 0, gl::kRgba, gl::kFloat}, "uploading normal"},
        {images.depth, &gl.pictures[2], {d.depth, 0, 0, gl::kRg, gl::kFloat}, "uploading depth"},
        {images.ids, &gl.pictures[3], {d.label, 0, 0, gl::kRgInteger, gl::kUnsignedInt}, "uploading label"}};
    std::vector<Wanted> wanted;
    for (Wanted w : all) {
        w.texture.width = d.width;
        w.texture.height = d.height;
        if (w.texture.name)
            wanted.push_back(w);
    }
    return wanted;
}

// rooms for the pictures, as pieces
Result<std::vector<GlLink::Piece>> pieces_of(GlLink& link, const std::vector<Wanted>& wanted)
{
    std::vector<GlLink::Piece> pieces;
    for (const Wanted& w : wanted) {
        SR_CHECK(link.make_room(*w.room, w.from.bytes(), false, "picture for GL"));
        pieces.push_back({w.from.slice(), w.room});
    }
    return pieces;
}

Status upload(GlLink& link, const std::vector<Wanted>& wanted)
{
    for (const Wanted& w : wanted)
        SR_CHECK(link.upload(*w.room, w.texture, w.what));
    return {};
}

Status check_world(const sr_gl& gl, const sr_world& world, const char* name)
{
    if (world.context != gl.context)
        return fail(ErrorCode::usage, "{}: the world belongs to another context", name);
    return {};
}

Status draw(sr_gl& gl, sr_world& world, const sr_gl_draw_desc& d)
{
    GlLink& link = *gl.link;
    SR_CHECK(check_world(gl, world, "sr_gl_draw"));
    if (d.unwaited > 1)
        return fail(ErrorCode::usage, "sr_gl_draw_desc: unwaited is {}, expected 0 or 1", d.unwaited);
    SR_CHECK(link.gl().take_errors("was set before sr_gl_draw"));
    const GlStateKept kept(link.gl());
    const bool unwaited = d.unwaited && link.way() == SR_GL_SHARED;
    SR_CHECK(splats_of(world, "sr_gl_draw").map([](SplatPool*) {}));
    SR_CHECK(show_updates(world, !unwaited));
    SR_TRY(const WorldDraw camera, draw_of(world, camera_of(d), formats_of(d)));
    if (unwaited) {
        SR_TRY(const VkCommandBuffer commands, link.begin());
        world.done = gl.context->drawing->next_point();
        SR_TRY(const SplatSlots images, record_splats(world, camera, commands, "sr_gl_draw"));
        const std::vector<Wanted> wanted = wanted_of(gl, d, images);
        SR_TRY(const std::vector<GlLink::Piece> pieces, pieces_of(link, wanted));
        SR_CHECK(link.finish(commands, pieces));
        return upload(link, wanted);
    }
    SR_TRY(const std::vector<SplatSlots> images, draw_splats(world, {&camera, 1}, "sr_gl_draw"));
    const std::vector<Wanted> wanted = wanted_of(gl, d, images[0]);
    SR_TRY(const std::vector<GlLink::Piece> pieces, pieces_of(link, wanted));
    SR_CHECK(link.send(pieces));
    return upload(link, wanted);
}

Status take(sr_gl& gl, sr_renderer& renderer, GlName texture)
{
    GlLink& link = *gl.link;
    if (renderer.context != gl.context)
        return fail(ErrorCode::usage, "sr_gl_take: the renderer belongs to another context");
    if (!texture)
        return fail(ErrorCode::usage, "sr_gl_take: texture is 0");
    if (!renderer.camera->frames())
        return fail(ErrorCode::usage, "sr_gl_take: no frame is finished");
    SR_CHECK(renderer.context->device->wait(renderer.context->device->last_ticket()));
    SR_CHECK(link.gl().take_errors("was set before sr_gl_take"));
    const GlStateKept kept(link.gl());
    const std::vector<Wanted> wanted{
        {renderer.camera->texels(),
         &gl.frame,
         {texture, renderer.size.width, renderer.size.height, gl::kRgba, gl::kUnsignedByte},
         "uploading a frame"}};
    SR_TRY(const std::vector<GlLink::Piece> pieces, pieces_of(link, wanted));
    SR_CHECK(link.send(pieces));
    return upload(link, wanted);
}

// all splats to the rooms; `rows` of `room` in each array
Status send_splats(sr_gl& gl, const SplatPool& pool)
{
    GlLink& link = *gl.link;
    const uint64_t rows = pool.end(), room = pool.scene().size();
    const auto [positions, normals, colors, labels, cells, owners] = pool.scene().arrays();
    const DeviceTensor arrays[] = {positions, normals, colors, labels, pool.scene().blocks()};
    std::vector<GlLink::Piece> pieces;
    for (size_t i = 0; i < std::size(gl.splats); ++i) {
        const BufferSlice all = arrays[i].slice();
        SR_CHECK(link.make_room(gl.splats[i], all.bytes, true, "splats for GL"));
        if (rows)
            pieces.push_back({all.part(0, all.bytes * rows / room), &gl.splats[i]});
    }
    if (pieces.empty())
        return {};
    SR_CHECK(link.send(pieces));
    for (const GlLink::Piece& piece : pieces)
        SR_CHECK(link.upload(*piece.to, piece.from.bytes));
    return {};
}

Status update_splats(sr_gl& gl, sr_world& world)
{
    SR_CHECK(check_world(gl, world, "sr_gl_get_splats"));
    SR_TRY(const SplatPool* pool, splats_of(world, "sr_gl_get_splats"));
    SR_CHECK(show_updates(world, true));
    if (gl.world_number == world.number && gl.known.version == pool->version())
        return {};
    SR_CHECK(gl.link->gl().take_errors("was set before sr_gl_get_splats"));
    const GlStateKept kept(gl.link->gl());
    if (gl.world_number != world.number)
        for (GlRoom& room : gl.splats)
            gl.link->drop(room);
    gl.world_number = 0; // until all of them are there
    SR_CHECK(send_splats(gl, *pool));
    gl.world_number = world.number;
    gl.known.count = pool->end();
    gl.known.version = pool->version();
    sr_gl_array* const arrays[] = {&gl.known.positions, &gl.known.normals, &gl.known.colors, &gl.known.labels,
                                   &gl.known.blocks};
    const uint64_t bytes[] = {16, 16, 16, 4, 4}, count = gl.known.count, blocks = count / SplatScene::kBlock;
    for (size_t i = 0; i < std::size(gl.splats); ++i)
        *arrays[i] = {gl.splats[i].buffer, 0, (i == 4 ? blocks : count) * bytes[i]};
    return {};
}

} // namespace

extern "C" {

sr_status sr_gl_create(sr_context* context, const sr_gl_desc* desc, sr_gl** gl)
{
    return guarded(context, [&]() -> Status {
        if (!context || !gl)
            return fail(ErrorCode::usage, "sr_gl_create: NULL");
        *gl = nullptr;
        SR_TRY(const sr_gl_desc known, read_struct(desc, "sr_gl_desc"));
        SR_TRY(auto made, make_gl(*context, known));
        *gl = made.release();
        return {};
    });
}

void sr_gl_destroy(sr_gl* gl)
{
    delete gl;
}

sr_status sr_gl_get_info(sr_gl* gl, sr_gl_info* info)
{
    return with_gl(gl, "sr_gl_get_info", [&] { return write_result(info_of(*gl), info, "sr_gl_get_info"); });
}

sr_status sr_gl_draw(sr_gl* gl, sr_world* world, const sr_gl_draw_desc* desc)
{
    return with_gl(gl, "sr_gl_draw", [&]() -> Status {
        if (!world)
            return fail(ErrorCode::usage, "sr_gl_draw: world is NULL");
        SR_TRY(const sr_gl_draw_desc known, read_struct(desc, "sr_gl_draw_desc"));
        return draw(*gl, *world, known);
    });
}

sr_status sr_gl_take(sr_gl* gl, sr_renderer* renderer, uint32_t texture)
{
    return with_gl<kAlone>(gl, "sr_gl_take", [&]() -> Status {
        if (!renderer)
            return fail(ErrorCode::usage, "sr_gl_take: renderer is NULL");
        return take(*gl, *renderer, texture);
    });
}

sr_status sr_gl_get_splats(sr_gl* gl, sr_world* world, sr_gl_splats* splats)
{
    return with_gl(gl, "sr_gl_get_splats", [&]() -> Status {
        if (!world)
            return fail(ErrorCode::usage, "sr_gl_get_splats: world is NULL");
        SR_CHECK(update_splats(*gl, *world));
        return write_result(gl->known, splats, "sr_gl_get_splats");
    });
}

} // extern "C"

static_assert(sizeof(sr_gl_desc) == 24 && sizeof(sr_gl_info) == 296 && sizeof(sr_gl_draw_desc) == 176);
static_assert(sizeof(sr_gl_array) == 16 && sizeof(sr_gl_splats) == 96);
