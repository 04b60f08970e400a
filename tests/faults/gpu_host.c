/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A host whose GPU fails at one call (tests/vendors/failing_gpu.cpp). A call that fails is made again, and goes on;
 * where the device is lost, all is destroyed, and the session begins again with another context. Prints a line for each
 * call that failed, and a hash of the pictures, which no failure changes. gpu_host MODEL [RENDERER] */
#include "tests/faults/session.h"

static void before_call(int attempt)
{
    (void)attempt;
}

static int again(const struct session* s, const char* call, sr_status status, int attempt)
{
    char line[512] = "";
    if (status == SR_OK)
        return 0;
    sr_last_error(s->context, line, sizeof line);
    printf("%s: %s: %s\n", call, sr_status_name(status), line);
    return status != SR_ERR_DEVICE_LOST && attempt < 2;
}

/* the status of the first call that fails for good */
static sr_status live(struct session* s)
{
    sr_status status;
    int frame;
    s->hash = 14695981039346656037u;
    GO(open_context(&s->context));
    GO(open_world(s, NULL));
    GO(focus_world(s));
    if ((status = fill_world(s)) != SR_OK)
        return status;
    GO(draw_world(s));
    GO(edit_world(s));
    if ((status = fill_world(s)) != SR_OK)
        return status;
    GO(draw_world(s));
    if (!s->weights)
        return SR_OK;
    GO(open_renderer(s));
    for (frame = 0; frame < FRAMES; ++frame) {
        GO(refine_frame(s, frame));
        GO(take_frame(s));
    }
    return SR_OK;
}

int main(int argc, char** argv)
{
    struct session s;
    sr_status status;
    CHECK(argc == 2 || argc == 3);
    memset(&s, 0, sizeof s);
    s.model = argv[1];
    s.weights = argc == 3 ? argv[2] : NULL;
    status = live(&s);
    if (status == SR_ERR_DEVICE_LOST) {
        end(&s);
        status = live(&s);
    }
    end(&s);
    printf("%016llx\n", (unsigned long long)s.hash);
    return status;
}
