/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * What cameras with lenses and rolling shutters and a lidar see of a world in which a car drives, and optical flow: the
 * numbers of `semrover render` of the same scene, rig and path.
 *
 *     capi_sensors MODEL SEMROVER FOLDER */
#include "tests/support/capi_car.h"
#include "tests/support/capi_png.h"

#include <math.h>

enum { FRAMES = 3, MOST_PIXELS = 64 * 40 };

static const char *program, *folder;

/* the sensors of the rig, but for poses */
static const struct sensor {
    const char* name;
    uint32_t width, height, model, shutter;
    double f[2];
    double distortion[12];
} kSensors[] = {
    {"front", 64, 40, SR_CAMERA_PINHOLE, SR_SHUTTER_GLOBAL, {32, 32}, {0}},
    {"rolling", 64, 40, SR_CAMERA_PINHOLE, SR_SHUTTER_DOWN, {32, 32}, {0}},
    {"wide", 64, 40, SR_CAMERA_OPENCV, SR_SHUTTER_UP, {32, 32}, {-0.2, 0.05, 0.001, -0.002, 0.01}},
    {"fish", 64, 40, SR_CAMERA_FISHEYE, SR_SHUTTER_LEFT, {18, 18}, {0.05, -0.01, 0.002, 0.001}},
    {"around",
     64,
     32,
     SR_CAMERA_EQUIRECTANGULAR,
     SR_SHUTTER_RIGHT,
     {64 / 6.283185307179586, 32 / 3.141592653589793},
     {0}},
    {"theta", 64, 40, SR_CAMERA_FTHETA, SR_SHUTTER_GLOBAL, {1, 1}, {25, 0, -0.5, 0, 0, 1, 0.01, -0.02, 1.4, 0}}};
enum { SENSORS = sizeof kSensors / sizeof kSensors[0] };

static const char* kDirections[] = {"", "down", "up", "right", "left"};
static const char* kRest =
    "\"sensor_to_vehicle\": {\"translation\": [0, 0, 1.5], \"rotation\": [-0.5, 0.5, -0.5, 0.5]}";

static FILE* open_file(const char* name, const char* mode)
{
    char path[1024];
    FILE* file;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    file = fopen(path, mode);
    if (!file)
        fprintf(stderr, "%s\n", path);
    CHECK(file);
    return file;
}

static void write_sensor(FILE* file, const struct sensor* s)
{
    int i;
    fprintf(file, "{\"name\": \"%s\", \"width\": %u, \"height\": %u, ", s->name, s->width, s->height);
    if (s->model == SR_CAMERA_EQUIRECTANGULAR)
        fprintf(file, "\"model\": \"equirectangular\", ");
    else if (s->model == SR_CAMERA_FTHETA)
        fprintf(file,
                "\"model\": \"ftheta\", \"principal_point\": [%g, %g], \"reference_poly\": \"ANGLE_TO_PIXELDIST\", "
                "\"angle_to_pixeldist_poly\": [0, %g, %g, %g], \"linear_cde\": [%g, %g, %g], \"max_angle\": %g, ",
                s->width / 2 - 0.5, s->height / 2 - 0.5, s->distortion[0], s->distortion[1], s->distortion[2],
                s->distortion[5], s->distortion[6], s->distortion[7], s->distortion[8]);
    else
        fprintf(file, "\"fx\": %g, \"fy\": %g, \"cx\": %u, \"cy\": %u, ", s->f[0], s->f[1], s->width / 2,
                s->height / 2);
    if (s->model == SR_CAMERA_OPENCV || s->model == SR_CAMERA_FISHEYE) {
        fprintf(file, "\"model\": \"%s\", \"distortion\": [", s->model == SR_CAMERA_OPENCV ? "opencv" : "fisheye");
        for (i = 0; i < (s->model == SR_CAMERA_OPENCV ? 8 : 4); ++i)
            fprintf(file, "%s%g", i ? ", " : "", s->distortion[i]);
        fprintf(file, "], ");
    }
    if (s->shutter)
        fprintf(file, "\"shutter\": {\"direction\": \"%s\", \"start\": -125000, \"readout\": 250000}, ",
                kDirections[s->shutter]);
    fprintf(file, "%s},\n ", kRest);
}

static void write_scene(const sr_grid* grid)
{
    char path[1024];
    FILE* file;
    int i;
    snprintf(path, sizeof path, "rm -rf %s && mkdir -p %s", folder, folder);
    CHECK(system(path) == 0);
    snprintf(path, sizeof path, "%s/car.sgrid", folder);
    CHECK_OK(NULL, sr_grid_write(grid, path));
    file = open_file("car.objects.json", "w");
    fprintf(file, "{\"format\": \"semrover.objects\", \"version\": 1, \"objects\": [{\"id\": 17, \"class\": \"car\", "
                  "\"center\": [6, 3.9, 1.2], \"size\": [2.4, 1.8, 1.2], \"heading\": 0}]}\n");
    CHECK(fclose(file) == 0);
    file = open_file("actors.json", "w");
    fprintf(file, "{\"format\": \"semrover.actors\", \"version\": 1, \"actors\": [{\"id\": 17, \"class\": \"car\", "
                  "\"size\": [2.4, 1.8, 1.2], \"from\": \"object\", \"poses\": [\n"
                  "{\"time\": 0, \"position\": [6, 3.9, 1.2], \"rotation\": [0, 0, 0, 1]},\n"
                  "{\"time\": 1000000, \"position\": [6.5, 5.75, 1.2], \"rotation\": [0, 0, 1, 0]}]}]}\n");
    CHECK(fclose(file) == 0);
    file = open_file("path.tum", "w");
    for (i = 0; i < FRAMES; ++i)
        fprintf(file, "%g %g 4.75 0 0 0 0 1\n", 0.25 * i, drive(0.25 * i));
    CHECK(fclose(file) == 0);
    file = open_file("small.json", "w");
    fprintf(file, "{\"columns\": 240, \"rate\": 8, \"range\": [0.3, 60], \"range_at_10_percent\": 40,\n"
                  "\"elevations\": [5, 1, -3, -6, -10, -15, -22, -30], \"azimuths\": [4, -1, 2, 0, 1, -3, 0.5, 7],\n"
                  "\"times\": [0, 50, 100, 150, 200, 250, 300, 350], \"every\": [2, 1, 1, 1, 1, 1, 1, 2]}\n");
    CHECK(fclose(file) == 0);
    file = open_file("rig.json", "w");
    fprintf(file, "{\"path_axes\": \"vehicle\", \"sensors\": [");
    for (i = 0; i < SENSORS; ++i)
        write_sensor(file, &kSensors[i]);
    fprintf(file, "{\"name\": \"top\", \"lidar\": \"small.json\", \"sensor_to_vehicle\": {\"translation\": [0, 0, 2], "
                  "\"rotation\": [0, 0, 0, 1]}}]}\n");
    CHECK(fclose(file) == 0);
}

static void render(void)
{
    char command[4096];
    snprintf(command, sizeof command,
             "%s render %s/car.sgrid --path %s/path.tum --rig %s/rig.json --actors %s/actors.json --instances --npy "
             "--flow flo --splat-radius %g -q -o %s/out",
             program, folder, folder, folder, folder, kSplatRadius, folder);
    printf("%s\n", command);
    fflush(stdout);
    CHECK(system(command) == 0);
}

static sr_draw_desc camera_of(const struct sensor* s, double time)
{
    sr_draw_desc draw = ahead(time, s->width, s->height, s->shutter);
    draw.camera_model = s->model;
    draw.fx = s->f[0];
    draw.fy = s->f[1];
    memcpy(draw.distortion, s->distortion, sizeof draw.distortion);
    return draw;
}

/* numbers of a .npy or .flo file, which are its last bytes; how many of `size` bytes there are */
static uint64_t read_numbers(const struct sensor* s, const char* kind, int number, const char* extension,
                             uint64_t header, void* numbers, uint64_t size)
{
    char name[512];
    uint8_t head[12];
    uint64_t count;
    FILE* file;
    snprintf(name, sizeof name, "out/%s/%s/%06d.%s", s ? s->name : "top", kind, number, extension);
    file = open_file(name, "rb");
    CHECK(fread(head, 1, sizeof head, file) == sizeof head);
    if (!header)
        header = 10u + head[8] + 256u * head[9];
    CHECK(fseek(file, (long)header, SEEK_SET) == 0);
    count = fread(numbers, 1, size, file);
    CHECK(fclose(file) == 0);
    return count;
}

static void read_picture(const struct sensor* s, const char* kind, int number, int type, int bits, void* pixels)
{
    char path[1024];
    snprintf(path, sizeof path, "%s/out/%s/%s/%06d.png", folder, s->name, kind, number);
    read_png_of(path, s->width, s->height, type, bits, pixels);
}

/* colour, depths, alpha and instances */
static void pictures_are_those_of_render(sr_context* context, sr_world* world, const struct sensor* s, int number)
{
    static uint8_t expected_color[MOST_PIXELS * 3];
    static float depth[MOST_PIXELS * 2], rgba[MOST_PIXELS * 4], mean[MOST_PIXELS], median[MOST_PIXELS],
        alpha[MOST_PIXELS];
    static uint32_t instance[MOST_PIXELS];
    static uint16_t expected_instance[MOST_PIXELS];
    const uint32_t pixels = s->width * s->height;
    sr_draw_desc draw = camera_of(s, 0.25 * number);
    uint32_t i, c, car = 0, covered = 0;
    draw.color.memory = rgba;
    draw.depth.memory = depth;
    draw.instance.memory = instance;
    CHECK_OK(context, sr_world_draw(world, &draw));
    read_picture(s, "color", number, PNG_COLOR_TYPE_RGB, 8, expected_color);
    read_picture(s, "instance", number, PNG_COLOR_TYPE_GRAY, 16, expected_instance);
    CHECK(read_numbers(s, "depth_expected", number, "npy", 0, mean, sizeof mean) == pixels * 4);
    CHECK(read_numbers(s, "depth_median", number, "npy", 0, median, sizeof median) == pixels * 4);
    CHECK(read_numbers(s, "alpha", number, "npy", 0, alpha, sizeof alpha) == pixels * 4);
    for (i = 0; i < pixels; ++i) {
        CHECK(depth[2 * i] == mean[i] && depth[2 * i + 1] == median[i] && rgba[4 * i + 3] == alpha[i]);
        for (c = 0; c < 3; ++c) /* rounded to a byte; where it is half way, either way */
            CHECK(fabs(255 * (double)rgba[4 * i + c] - expected_color[3 * i + c]) < 0.5 + 1e-4);
        CHECK(instance[i] == expected_instance[i]);
        car += instance[i] == CAR + 1;
        covered += alpha[i] > 0.5f;
    }
    printf("%s %d: %u of %u pixels, %u of the car\n", s->name, number, covered, pixels, car);
    CHECK(car > 20 && covered > pixels / 8);
}

static void flow_is_that_of_render(sr_context* context, sr_world* world, const struct sensor* s, int number)
{
    static float flow[MOST_PIXELS * 2], expected[MOST_PIXELS * 2];
    static uint32_t states[MOST_PIXELS];
    static uint8_t expected_states[MOST_PIXELS];
    const uint32_t pixels = s->width * s->height;
    const sr_draw_desc now = camera_of(s, 0.25 * number), next = camera_of(s, 0.25 * (number + 1));
    sr_target to_flow = {0}, to_states = {0};
    uint32_t i, of[4] = {0, 0, 0, 0};
    to_flow.memory = flow;
    to_states.memory = states;
    CHECK_OK(context, sr_world_flow(world, &now, &next, &to_flow, &to_states));
    CHECK(read_numbers(s, "flow", number, "flo", 12, expected, sizeof expected) == pixels * 8);
    read_picture(s, "flow_state", number, PNG_COLOR_TYPE_GRAY, 8, expected_states);
    CHECK(!memcmp(flow, expected, pixels * 8));
    for (i = 0; i < pixels; ++i) {
        CHECK(states[i] == expected_states[i] && states[i] < 4);
        ++of[states[i]];
    }
    printf("flow of %s: %u nothing, %u seen, %u hidden, %u outside\n", s->name, of[0], of[1], of[2], of[3]);
    CHECK(of[SR_FLOW_NOTHING] > 0 && of[SR_FLOW_SEEN] > pixels / 8);
    memset(states, 0, sizeof states); /* one of them alone */
    CHECK_OK(context, sr_world_flow(world, &now, &next, NULL, &to_states));
    for (i = 0; i < pixels; ++i)
        CHECK(states[i] == expected_states[i]);
}

/* above the vehicle */
static void sensor_pose(double x, double pose[12])
{
    const double to_world[12] = {1, 0, 0, 0, 0, 1, 0, 4.75, 0, 0, 1, 2};
    memcpy(pose, to_world, sizeof to_world);
    pose[3] = x;
}

static void sweeps_are_those_of_render(sr_context* context, sr_world* world, int number)
{
    enum { MOST = 240 * 8 };
    static sr_lidar_return returns[MOST];
    static float expected[MOST * 8];
    char lidar[1024];
    sr_sweep_desc sweep = SR_INIT(sr_sweep_desc);
    uint64_t count = 0, car = 0, i;
    snprintf(lidar, sizeof lidar, "%s/small.json", folder);
    sweep.lidar = lidar;
    sweep.time = 0.25 * number;
    sensor_pose(drive(sweep.time - 0.125), sweep.sensor_to_world_begin);
    sensor_pose(drive(sweep.time), sweep.sensor_to_world_end);
    CHECK_OK(context, sr_world_sweep(world, &sweep, NULL, &count));
    CHECK(count == 240 * 7); /* two beams fire in every other column */
    CHECK_OK(context, sr_world_sweep(world, &sweep, returns, &count));
    CHECK(read_numbers(NULL, "points", number, "npy", 0, expected, sizeof expected) == count * 32);
    for (i = 0; i < count; ++i) {
        const float* e = expected + 8 * i;
        const sr_lidar_return* r = &returns[i];
        CHECK(r->x == e[0] && r->y == e[1] && r->z == e[2] && r->intensity == e[3]);
        CHECK((float)r->ring == e[4] && (float)r->time_us == e[5] && (float)r->label == e[6] &&
              (float)r->instance == e[7]);
        car += r->instance == CAR + 1;
    }
    printf("sweep %d: %u returns, %u of the car\n", number, (unsigned)count, (unsigned)car);
    CHECK(count > 300 && (number ? car > 10 : car == 0)); /* the first sweep ends when the car comes */
    count = 5;
    CHECK(sr_world_sweep(world, &sweep, returns, &count) == SR_ERR_PARTIAL && count == 5);
    CHECK(says(context, "room for 5"));
}

/* of a lidar that stands in the middle of a road */
static uint64_t standing_sweep(sr_context* context, sr_world* world, const char* table, sr_lidar_return* returns)
{
    char lidar[1024];
    sr_sweep_desc sweep = SR_INIT(sr_sweep_desc);
    uint64_t count = 240 * 8;
    snprintf(lidar, sizeof lidar, "%s/%s", folder, table);
    sweep.lidar = lidar;
    sensor_pose(0, sweep.sensor_to_world_begin);
    sweep.sensor_to_world_begin[7] = 0;
    memcpy(sweep.sensor_to_world_end, sweep.sensor_to_world_begin, sizeof sweep.sensor_to_world_end);
    CHECK_OK(context, sr_world_sweep(world, &sweep, returns, &count));
    return count;
}

/* a street grows: the lidar that was there before sees what one sees that comes now */
static void a_sweep_sees_what_is_made_later(sr_context* context, const char* model)
{
    static sr_lidar_return known[240 * 8], fresh[240 * 8];
    sr_world_desc desc = street_world();
    sr_world* world = NULL;
    uint64_t before, count;
    desc.splat_radius = kSplatRadius;
    CHECK_OK(context, create_world(context, model, &desc, &world));
    CHECK(standing_sweep(context, world, "small.json", known) == 0);
    walk(context, world, 0, 1);
    before = standing_sweep(context, world, "small.json", known);
    walk(context, world, 4, 12);
    count = standing_sweep(context, world, "small.json", known);
    printf("%u returns of %u splats, before %u\n", (unsigned)count, (unsigned)world_info(world).splats,
           (unsigned)before);
    CHECK(before > 100 && count > before + 100);
    CHECK(standing_sweep(context, world, "./small.json", fresh) == count);
    CHECK(memcmp(known, fresh, count * sizeof *known) == 0);
    sr_world_destroy(world);
}

static void refuses_wrong_sweeps(sr_context* context, sr_world* world)
{
    sr_sweep_desc sweep = SR_INIT(sr_sweep_desc);
    sr_lidar_return one;
    uint64_t count = 1;
    CHECK(sr_world_sweep(world, &sweep, &one, &count) == SR_ERR_USAGE && says(context, "lidar is NULL"));
    CHECK(sr_world_sweep(world, &sweep, &one, NULL) == SR_ERR_USAGE && says(context, "count is NULL"));
    CHECK(sr_world_sweep(NULL, &sweep, &one, &count) == SR_ERR_USAGE && says(NULL, "world is NULL"));
    sweep.lidar = "none";
    CHECK(sr_world_sweep(world, &sweep, &one, &count) == SR_ERR_BAD_INPUT && says(context, "none"));
    sweep.lidar = "/none.json";
    CHECK(sr_world_sweep(world, &sweep, &one, &count) == SR_ERR_BAD_INPUT && says(context, "/none.json"));
    sweep.lidar = "xt32";
    CHECK(sr_world_sweep(world, &sweep, &one, &count) == SR_ERR_BAD_INPUT && says(context, "sensor_to_world_begin"));
    sensor_pose(0, sweep.sensor_to_world_begin);
    CHECK(sr_world_sweep(world, &sweep, &one, &count) == SR_ERR_BAD_INPUT && says(context, "sensor_to_world_end"));
    sensor_pose(0, sweep.sensor_to_world_end);
    CHECK_OK(context, sr_world_sweep(world, &sweep, NULL, &count));
    CHECK(count == 32 * 2000);
    sweep.least_alpha = 1.5;
    CHECK(sr_world_sweep(world, &sweep, &one, &count) == SR_ERR_USAGE && says(context, "least_alpha is 1.5"));
    sweep.least_alpha = 0;
    sweep.time = 1e300;
    CHECK(sr_world_sweep(world, &sweep, &one, &count) == SR_ERR_USAGE && says(context, "time is 1e+300"));
}

int main(int argc, char** argv)
{
    const sr_actor car = driving_car();
    sr_context* context = NULL;
    sr_grid* grid;
    sr_world* world;
    int s, number;
    CHECK(argc == 4);
    program = argv[2];
    folder = argv[3];
    sr_set_diagnostic_callback(print_line, stderr);
    CHECK(sr_context_create(NULL, &context) == SR_OK);
    grid = car_points(context, argv[1]);
    write_scene(grid);
    render();
    world = car_world(context, grid);
    CHECK_OK(context, sr_world_set_actors(world, &car, 1));
    for (s = 0; s < SENSORS; ++s)
        for (number = 0; number < FRAMES; ++number) {
            pictures_are_those_of_render(context, world, &kSensors[s], number);
            if (number + 1 < FRAMES)
                flow_is_that_of_render(context, world, &kSensors[s], number);
        }
    for (number = 0; number < FRAMES; ++number)
        sweeps_are_those_of_render(context, world, number);
    refuses_wrong_sweeps(context, world);
    a_sweep_sees_what_is_made_later(context, argv[1]);
    sr_world_destroy(world);
    sr_grid_destroy(grid);
    sr_context_destroy(context);
    return 0;
}
