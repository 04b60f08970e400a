/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Cubes of the host's among the splats of the street: one on the road, one sunk into it by half, and one behind the
 * wall, which it overtops. */
#ifndef HOST_CUBES_H
#define HOST_CUBES_H

struct cube {
    float center[3], half; /* metres */
    float color[3];
};

static const struct cube cubes[3] = {
    {{9, 1.2f, 1.1f}, 0.5f, {0.9f, 0.1f, 0.1f}},
    {{7, -1.8f, 0.5f}, 0.6f, {0.1f, 0.8f, 0.2f}},
    {{12, 7.5f, 2.2f}, 1.8f, {0.1f, 0.2f, 0.9f}},
};

#endif
