/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * The street of the sample hosts: a road along x with pavements and a low wall on each side, without end. Its labels
 * come from a callback, as in a game that has its own idea of the city. */
#ifndef HOST_STREET_H
#define HOST_STREET_H

#include <semrover.h>

#define VOXEL 0.6 /* metres, of the models */

/* one column of voxels of a window at a time; how high it is depends on j, across the street */
static sr_status street_labels(void* user, const sr_cell_rect* window, sr_grid* grid)
{
    int32_t i, j, k;
    (void)user;
    for (i = window->low[0]; i <= window->high[0]; ++i)
        for (j = window->low[1]; j <= window->high[1]; ++j) {
            const int32_t side = j < 0 ? -1 - j : j; /* 0 and on, away from the middle */
            sr_cell cells[4];
            sr_status status;
            if (side > 8)
                continue;
            for (k = 0; k < (side == 8 ? 4 : 1); ++k) {
                cells[k].i = i;
                cells[k].j = j;
                cells[k].k = k;
                cells[k].label = side == 8 ? 2u : side > 5 ? 1u : 0u; /* building, sidewalk, road */
            }
            status = sr_grid_set_cells(grid, cells, (uint64_t)k);
            if (status != SR_OK)
                return status;
        }
    return SR_OK;
}

/* model: a folder. Its weights stay as long as the world */
static sr_status make_street(sr_context* context, const char* model, sr_world** world)
{
    const sr_model_desc model_desc = {.struct_size = sizeof model_desc, .path = model, .parts = SR_MODEL_VOXFIELD};
    sr_world_desc desc = {.struct_size = sizeof desc,
                          .steps = 4, /* for a quick look; 0: as the model says */
                          .labels = street_labels,
                          .host_bytes = 256u << 20,
                          .splat_bytes = 32u << 20};
    sr_model* loaded = NULL;
    sr_status status = sr_model_load(context, &model_desc, &loaded);
    desc.model = loaded;
    if (status == SR_OK)
        status = sr_world_create(context, &desc, world);
    sr_model_destroy(loaded);
    return status;
}

#endif
