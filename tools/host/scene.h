/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A frame of a sample host: the library's splats and cubes of the host's, in one z-buffer. The library draws color and
 * depth into two buffers; a render pass of the host's writes both into its picture, and draws cubes with depth test. */
#ifndef HOST_SCENE_H
#define HOST_SCENE_H

#include "flight.h"

enum { MOST_PICTURES = 8, FRAMES_ON_THEIR_WAY = 2 };

struct scene {
    const struct gpu* gpu;
    uint32_t width, height;
    struct buffer color, depth; /* what the library draws */
    struct image z;
    VkRenderPass pass;
    VkFramebuffer framebuffers[MOST_PICTURES]; /* of the pictures */
    uint32_t pictures;
    VkDescriptorSetLayout set_layout;
    VkPipelineLayout layout;
    VkDescriptorPool pool;
    VkDescriptorSet set;
    VkPipeline splats, cubes;
};

/* views: of the pictures that are drawn into, which each frame leaves in `layout` */
void scene_create(struct scene* scene, const struct gpu* gpu, const VkImageView* views, uint32_t pictures,
                  VkFormat format, VkImageLayout layout, uint32_t width, uint32_t height);
void scene_destroy(struct scene* scene); /* the device must have finished with it */

/* what a camera at `position` sees that looks `yaw` radians to the left of x, 90 degrees across */
void scene_look(const struct scene* scene, const double position[3], double yaw, sr_draw_desc* draw);

/* what the thread that draws asks of the library, and waits for by itself */
enum call { CALL_FOCUS, CALL_EDIT, CALL_UPDATES, CALL_RECORD, CALL_CHECK, CALL_FRAME_BEFORE, CALL_FRAME, CALLS };
extern struct calls scene_calls[CALLS];

/* Records a whole frame into a command buffer that has begun; done: of the frame. world: NULL: only the cubes */
void scene_record(const struct scene* scene, sr_world* world, const sr_draw_desc* draw, const sr_semaphore* done,
                  uint32_t picture, VkCommandBuffer commands);

/* A copy of a picture that lies in TRANSFER_SRC_OPTIMAL, for the host to see when the commands are done */
void scene_copy(const struct scene* scene, VkImage picture, const struct buffer* pixels, VkCommandBuffer commands);

#endif
