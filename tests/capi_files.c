/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A host in C that has models in memory: worlds and renderers have the bytes that they have from a folder, and share
 * its cache; and what an application may get wrong.
 *
 *     capi_files MODEL RENDERER FOLDER     FOLDER: for the cache, which is emptied */
#include "tests/support/capi_street.h"

enum { WIDTH = 24, HEIGHT = 16, PIXELS = WIDTH * HEIGHT, MOST_FILES = 8 };

static const char *model, *weights, *folder;

/* files of a model, at odd addresses */
struct files {
    sr_file files[MOST_FILES];
    char* memory[MOST_FILES];
    uint64_t count;
};

static void read_one(struct files* files, const char* from, const char* path)
{
    char name[1024];
    FILE* file;
    long bytes;
    sr_file* made = &files->files[files->count];
    CHECK(files->count < MOST_FILES);
    snprintf(name, sizeof name, "%s/%s", from, path);
    file = fopen(name, "rb");
    CHECK(file && fseek(file, 0, SEEK_END) == 0);
    bytes = ftell(file);
    CHECK(bytes > 0 && fseek(file, 0, SEEK_SET) == 0);
    files->memory[files->count] = malloc((size_t)bytes + 1);
    CHECK(files->memory[files->count]);
    CHECK(fread(files->memory[files->count] + 1, 1, (size_t)bytes, file) == (size_t)bytes);
    fclose(file);
    made->path = path;
    made->data = files->memory[files->count] + 1;
    made->bytes = (uint64_t)bytes;
    ++files->count;
}

/* nobody reads them any more: what would is told by other bytes */
static void free_files(struct files* files)
{
    uint64_t i;
    for (i = 0; i < files->count; ++i) {
        memset(files->memory[i], 0x5a, (size_t)files->files[i].bytes + 1);
        free(files->memory[i]);
    }
    files->count = 0;
}

static struct files model_in_memory(void)
{
    struct files files;
    memset(&files, 0, sizeof files);
    read_one(&files, model, "config.json");
    read_one(&files, model, "diffusion_pytorch_model.safetensors");
    return files;
}

static struct files renderer_in_memory(void)
{
    static const char* const paths[] = {"model_index.json",
                                        "renderer/config.json",
                                        "renderer/diffusion_pytorch_model.safetensors",
                                        "vae/config.json",
                                        "vae/diffusion_pytorch_model.safetensors",
                                        "scheduler/scheduler_config.json",
                                        "conditioning/conditioning.safetensors"};
    struct files files;
    size_t i;
    memset(&files, 0, sizeof files);
    for (i = 0; i < sizeof paths / sizeof *paths; ++i)
        read_one(&files, weights, paths[i]);
    return files;
}

static sr_model_desc with_files(const struct files* files)
{
    sr_model_desc desc = model_at(NULL);
    desc.files = files->files;
    desc.file_count = files->count;
    return desc;
}

static sr_status try_load(sr_context* context, const sr_model_desc* desc)
{
    sr_model* loaded = NULL;
    const sr_status status = sr_model_load(context, desc, &loaded);
    CHECK(!loaded == (status != SR_OK));
    sr_model_destroy(loaded);
    return status;
}

/* a world of a model that is loaded for it */
static sr_world* open_world(sr_context* context, const sr_model_desc* model_desc, const char* cache)
{
    sr_world_desc desc = street_world();
    sr_world* world = NULL;
    sr_model* loaded = NULL;
    CHECK_OK(context, sr_model_load(context, model_desc, &loaded));
    desc.model = loaded;
    desc.cache = cache;
    CHECK_OK(context, sr_world_create(context, &desc, &world));
    sr_model_destroy(loaded);
    return world;
}

static void draw(sr_context* context, sr_world* world, float* color)
{
    sr_draw_desc desc = camera_at(1, WIDTH, HEIGHT);
    desc.color.memory = color;
    CHECK_OK(context, sr_world_draw(world, &desc));
}

static float from_folder[PIXELS * 4], from_memory[PIXELS * 4];

/* a world that finds all of its tiles there; they come in another order, so that sums of splats round in another way */
static void from_cache(sr_context* context, const sr_model_desc* desc, float* color)
{
    sr_world* world = open_world(context, desc, folder);
    walk(context, world, 2, 2);
    draw(context, world, color);
    CHECK(world_info(world).generated == 0 && world_info(world).loaded > 0);
    sr_world_destroy(world);
}

/* generated from the folder into a cache, generated from memory, and read from the folder's cache */
static sr_world* worlds_are_the_same(sr_context* context, struct files* files)
{
    const sr_model_desc on_disk = model_at(model), in_memory = with_files(files);
    sr_world *read, *made;
    char command[1024];
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    CHECK(system(command) == 0);
    read = open_world(context, &on_disk, folder);
    walk(context, read, 2, 2);
    draw(context, read, from_folder);
    CHECK(from_folder[4 * PIXELS - 1] > 0.5f);
    CHECK_OK(context, sr_world_flush(read));
    sr_world_destroy(read);
    made = open_world(context, &in_memory, NULL);
    walk(context, made, 2, 2);
    draw(context, made, from_memory);
    CHECK(world_info(made).generated > 0 && !memcmp(from_folder, from_memory, sizeof from_folder));
    from_cache(context, &on_disk, from_folder);
    from_cache(context, &in_memory, from_memory);
    CHECK(!memcmp(from_folder, from_memory, sizeof from_folder));
    return made;
}

/* in a folder of its own among the files */
static void a_model_may_lie_deeper(sr_context* context)
{
    struct files files = model_in_memory();
    sr_model_desc desc;
    files.files[0].path = "models/street/voxfield_transformer/config.json";
    files.files[1].path = "models/street/voxfield_transformer/diffusion_pytorch_model.safetensors";
    desc = with_files(&files);
    CHECK(try_load(context, &desc) == SR_ERR_BAD_INPUT && says(context, "diffusers layout"));
    desc.path = "models/street";
    CHECK_OK(context, try_load(context, &desc));
    free_files(&files);
}

static void refuses_wrong_files(sr_context* context)
{
    struct files files = model_in_memory();
    sr_model_desc desc = with_files(&files);
    desc.file_count = 0;
    CHECK(try_load(context, &desc) == SR_ERR_USAGE && says(context, "come together"));
    desc = with_files(&files);
    desc.files = NULL;
    CHECK(try_load(context, &desc) == SR_ERR_USAGE && says(context, "come together"));
    desc.file_count = 0;
    CHECK(try_load(context, &desc) == SR_ERR_USAGE && says(context, "path is NULL"));
    desc = with_files(&files);
    files.files[0].path = "../config.json";
    CHECK(try_load(context, &desc) == SR_ERR_USAGE && says(context, "../config.json"));
    files.files[0].path = "a/../../config.json";
    CHECK(try_load(context, &desc) == SR_ERR_USAGE && says(context, "expected one below"));
    files.files[0].path = "/config.json";
    CHECK(try_load(context, &desc) == SR_ERR_USAGE && says(context, "expected one below"));
    files.files[0].path = "";
    CHECK(try_load(context, &desc) == SR_ERR_USAGE && says(context, "expected one below"));
    files.files[0].path = NULL;
    CHECK(try_load(context, &desc) == SR_ERR_USAGE && says(context, "file 0 of 2 has no path"));
    files.files[0].path = "./diffusion_pytorch_model.safetensors";
    CHECK(try_load(context, &desc) == SR_ERR_USAGE && says(context, "two files"));
    files.files[0].path = "config.json";
    desc.file_count = 1;
    CHECK(try_load(context, &desc) == SR_ERR_BAD_INPUT && says(context, "safetensors"));
    desc = with_files(&files);
    files.files[1].bytes -= 4;
    CHECK(try_load(context, &desc) == SR_ERR_BAD_INPUT && says(context, "safetensors"));
    files.files[1].bytes = 0;
    CHECK(try_load(context, &desc) == SR_ERR_BAD_INPUT && says(context, "safetensors"));
    files.files[1].bytes = 4;
    files.files[1].data = NULL;
    CHECK(try_load(context, &desc) == SR_ERR_USAGE && says(context, "file 1 of 2"));
    free(files.memory[0]);
    free(files.memory[1]);
}

static sr_renderer_desc renderer_desc(void)
{
    sr_renderer_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.width = WIDTH;
    desc.height = HEIGHT;
    desc.steps = 1;
    desc.noise = SR_NOISE_FRESH;
    return desc;
}

static void refine(sr_context* context, sr_renderer* renderer, uint8_t* frame)
{
    static uint8_t seen[PIXELS * 4];
    sr_frame_desc desc;
    sr_target target;
    uint32_t done = 0, i;
    for (i = 0; i < sizeof seen; ++i)
        seen[i] = (uint8_t)(i % 4 == 3 ? 255 : i * 7);
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.seen.memory = seen;
    memset(&target, 0, sizeof target);
    target.memory = frame;
    CHECK_OK(context, sr_renderer_begin(renderer, &desc));
    while (!done)
        CHECK_OK(context, sr_renderer_step(renderer, 20000, &done));
    CHECK_OK(context, sr_renderer_take(renderer, &target));
}

static uint64_t device_bytes(sr_renderer* renderer)
{
    sr_renderer_info info;
    memset(&info, 0, sizeof info);
    info.struct_size = sizeof info;
    CHECK(sr_renderer_get_info(renderer, &info) == SR_OK);
    return info.device_bytes;
}

static sr_renderer* open_renderer(sr_context* context, const sr_model_desc* model_desc)
{
    sr_renderer_desc desc = renderer_desc();
    sr_renderer* renderer = NULL;
    sr_model* loaded = NULL;
    CHECK_OK(context, sr_model_load(context, model_desc, &loaded));
    desc.model = loaded;
    CHECK_OK(context, sr_renderer_create(context, &desc, &renderer));
    sr_model_destroy(loaded);
    return renderer;
}

/* also where networks are loaded in turn, and so are read again for every frame */
static void renderers_are_the_same(sr_context* context)
{
    static uint8_t expected[PIXELS * 4], found[PIXELS * 4];
    struct files files = renderer_in_memory();
    const sr_model_desc on_disk = model_at(weights), in_memory = with_files(&files);
    sr_model_desc desc = in_memory;
    sr_context_desc small;
    sr_context* in_turns = NULL;
    sr_renderer* renderer = open_renderer(context, &on_disk);
    refine(context, renderer, expected);
    memset(&small, 0, sizeof small);
    small.struct_size = sizeof small;
    small.max_bytes = device_bytes(renderer) - 1;
    sr_renderer_destroy(renderer);
    renderer = open_renderer(context, &in_memory);
    refine(context, renderer, found);
    CHECK(!memcmp(found, expected, sizeof found));
    sr_renderer_destroy(renderer);
    CHECK_OK(NULL, sr_context_create(&small, &in_turns));
    renderer = open_renderer(in_turns, &in_memory);
    CHECK(device_bytes(renderer) < small.max_bytes);
    refine(in_turns, renderer, found);
    CHECK(!memcmp(found, expected, sizeof found));
    refine(in_turns, renderer, found);
    sr_renderer_destroy(renderer);
    sr_context_destroy(in_turns);
    desc.file_count = 1;
    CHECK(try_load(context, &desc) == SR_ERR_BAD_INPUT && says(context, "has no"));
    free_files(&files);
}

int main(int argc, char** argv)
{
    const struct host host = make_host();
    const sr_vulkan_device vulkan = lent(&host);
    sr_context_desc desc;
    sr_context* context = NULL;
    sr_world* world;
    struct files files;
    CHECK(argc == 4);
    model = argv[1];
    weights = argv[2];
    folder = argv[3];
    sr_set_diagnostic_callback(print_line, stderr);
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.vulkan = &vulkan;
    CHECK_OK(NULL, sr_context_create(&desc, &context));
    files = model_in_memory();
    world = worlds_are_the_same(context, &files);
    refuses_wrong_files(context); /* while a world has files of the same names */
    a_model_may_lie_deeper(context);
    sr_world_destroy(world);
    free_files(&files);
    renderers_are_the_same(context);
    sr_context_destroy(context);
    destroy_host(&host);
    return 0;
}
