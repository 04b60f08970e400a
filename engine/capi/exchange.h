// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/capi/call.h"
#include "engine/capi/handles.h"
#include "engine/capi/picture_formats.h"

// pictures on their way between our memory and what an application gives: its memory, buffers and images
namespace semrover::capi {

constexpr uint32_t kMostPixels = 16384; // of a side

// of microseconds; beyond some thousand years it is none
JobBudget timed_budget(uint64_t microseconds);

// Errors: usage for sizes that are not 1..kMostPixels. name: of the structure
Status check_size(const ImageSize& size, const char* name);

ExternalTarget external_target(const sr_target& to, const ImageSize& size);

// What a draw is tested against. Errors: usage for another format than two, layouts that are UNDEFINED, and numbers
// that are not finite
Result<ExternalImage> external_depth(const sr_depth_image& depth, const ImageSize& size);
std::array<float, 2> z_scale(const sr_depth_image& depth);
std::array<float, 2> depth_scale(const sr_draw_desc& draw); // of the picture

Result<ExternalCopies*> copies_of(sr_context& context);

// a picture, and where the application wants it
struct WantedPicture {
    BufferSlice pixels;
    const sr_target* target;
    ImageSize size;
};
Status hand_over(sr_context& context, std::span<const WantedPicture> pictures); // waits for it

// `bytes` of the application's to the beginning of a slot; waits for it. Errors: usage unless there is one of memory
// and buffer. name: of the member
Status take_in(sr_context& context, const sr_source& from, const DeviceTensor& to, uint64_t bytes, const char* name);

// What is wanted of a draw. kept: as draw_splats() returns it
std::vector<WantedPicture> wanted_pictures(const sr_draw_desc& draw, const PictureFormats& formats, SplatSlots kept);

// Errors: usage for a world without splat_bytes. name: of the call
Result<SplatPool*> splats_of(const sr_world& world, const char* name);

// Into commands, or by our own: what was published is shown to what follows. Rasterizers that nothing needs any more
// go. false: there was nothing. done: as sr_world_record_updates has it
Result<bool> record_updates(sr_world& world, VkCommandBuffer commands, const TimelinePoint& done);
Status show_updates(sr_world& world, bool wait);

} // namespace semrover::capi
