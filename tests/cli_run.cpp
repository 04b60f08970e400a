// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "runtime/base/json.h"
#include "tests/support/child_program.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"
#include "tests/support/renderer_folders.h"

#include <algorithm>
#include <fstream>
#include <map>
#include <random>
#include <thread>

namespace semrover {
namespace cli_run_test {

namespace fs = std::filesystem;
using Json = nlohmann::json;

// 60 voxels: a road, and a wall at one side
VoxelGrid labels(uint8_t wall)
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    for (int32_t i = 0; i < 10; ++i)
        for (int32_t j = 0; j < 6; ++j)
            grid.cells.push_back({i, j, j == 5 ? 1 : 0});
    for (const Cell& cell : grid.cells)
        grid.labels.push_back(cell[2] ? wall : 0);
    sort_cells(grid);
    return grid;
}

class CliRun : public testing::Test {
  protected:
    CliRun()
    {
        put_renderer_model(folder_ / "model");
        fs::copy(SEMROVER_SOURCE_DIR "/tests/golden/sampling_ddpm/model", folder_ / "model" / "voxfield_transformer",
                 fs::copy_options::recursive);
        fs::create_directories(folder_ / "scenes");
        for (const auto& [name, wall] : {std::pair("a", 2), std::pair("b", 8), std::pair("c", 1)})
            EXPECT_TRUE(write_grid(folder_ / "scenes" / (std::string(name) + ".sgrid"), labels(uint8_t(wall))));
        put_path("ahead.tum", {0.2, 0.8, 1.4});
        put_path("back.tum", {1.0, 0.4});
        put_job();
    }

    void put_path(const char* name, std::initializer_list<double> places) const
    {
        std::string poses;
        for (const double x : places)
            poses += fmt::format("{0} {0} 1.8 1.6 -0.5 0.5 -0.5 0.5\n", x);
        folder_.put(name, poses);
    }
    // 3 scenes, 2 drives, refined
    void put_job(const std::string& more = "") const
    {
        folder_.put("job.toml", R"(name = "three"
out = "out"
model = "model"
seed = 7
[[scene]]
labels = "scenes/*.sgrid"
[[drive]]
name = "ahead"
path = "ahead.tum"
width = 56
height = 40
[[drive]]
name = "back"
path = "back.tum"
width = 40
height = 32
[generate]
steps = 2
region_size = 24
coverage_threshold = 6
[refine]
steps = 2
)" + more);
    }
    std::string path(std::string_view name) const { return (folder_ / name).string(); }
    std::string line(const std::string& more = "", const std::string& job = "job.toml") const
    {
        return "run " + path(job) + " --quiet " + more;
    }
    ProgramResult run(const std::string& more = "", const std::string& job = "job.toml") const
    {
        return semrover_program(line(more, job));
    }
    Json report(const std::string& more = "") const
    {
        const ProgramResult result = run("--json " + more);
        EXPECT_EQ(result.code, 0) << result.err;
        return Json::parse(result.out, nullptr, false);
    }
    // the bytes of all that is published but manifests, by name
    std::map<std::string, std::string> published(const std::string& output = "out") const
    {
        std::map<std::string, std::string> files;
        for (const char* stage : {"scenes", "drives"})
            for (const auto& entry : fs::recursive_directory_iterator(folder_ / output / stage))
                if (entry.is_regular_file() && entry.path().filename() != "manifest.json")
                    files[entry.path().lexically_relative(folder_ / output).string()] = contents(entry.path());
        return files;
    }
    size_t attempts(const std::string& output = "out") const
    {
        size_t count = 0;
        for (const auto& entry : fs::directory_iterator(folder_ / output / ".work"))
            count += entry.path().filename() != "failed";
        return count;
    }
    Json manifest(const std::string& task, const std::string& output = "out") const
    {
        return Json::parse(contents(folder_ / output / task / "manifest.json"), nullptr, false);
    }

    ScratchFolder folder_;
};

TEST_F(CliRun, the_bytes_do_not_depend_on_parts)
{
    const Json whole = report();
    EXPECT_EQ(whole["done"], 9);
    const auto files = published();
    // scene.sgrid of 3; of 6 drives 5 frames a scene with 5 buffers each, transforms.json; of that with times 3 files
    // more
    EXPECT_EQ(files.size(), 3u + 3u * (2u + 3u + 5u * 6u));
    EXPECT_EQ(attempts(), 0u);
    for (const int parts : {1, 3, 7}) {
        const std::string output = fmt::format("out{}", parts);
        size_t done = 0;
        for (int part = parts; part-- > 0;)
            done += report(fmt::format("-o {} --part {}/{}", path(output), part, parts))["done"].get<size_t>();
        EXPECT_EQ(done, 9u);
        EXPECT_TRUE(published(output) == files) << parts;
    }
    const Json again = report();
    EXPECT_EQ(again["done"], 0);
    EXPECT_EQ(again["were_done"], 9);
}

TEST_F(CliRun, a_dry_run_says_what_is_left)
{
    const ProgramResult dry = run("--dry-run --json");
    EXPECT_EQ(dry.code, 0) << dry.err;
    const Json all = Json::parse(dry.out, nullptr, false);
    EXPECT_EQ(all["scenes"], 3);
    EXPECT_EQ(all["drives"], 6);
    EXPECT_EQ(all["frames"], 3 * (3 + 2));
    EXPECT_EQ(all["done"], 0);
    EXPECT_GT(all["seconds"], 0.0);
    EXPECT_GT(all["device_bytes"], 1 << 16);
    EXPECT_FALSE(fs::exists(folder_ / "out")) << "the trial leaves nothing";
    EXPECT_EQ(run().code, 0);
    uint64_t bytes = 0, files = 0;
    for (const char* stage : {"scenes", "drives"})
        for (const auto& entry : fs::recursive_directory_iterator(folder_ / "out" / stage))
            if (entry.is_regular_file() && entry.path().filename() != "manifest.json") {
                bytes += entry.file_size();
                ++files;
            }
    EXPECT_NEAR(all["bytes"].get<double>(), double(bytes), 0.4 * double(bytes));
    EXPECT_NEAR(all["files"].get<double>(), double(files), 0.3 * double(files));
    EXPECT_EQ(Json::parse(run("--dry-run --json").out, nullptr, false)["done"], 9);
}

TEST_F(CliRun, stages_can_be_apart)
{
    const ProgramResult early = run("--stage drive --wait 0");
    EXPECT_EQ(early.code, 75);
    EXPECT_NE(early.err.find("scenes/a is not there (yet)"), std::string::npos) << early.err;
    for (int part = 0; part < 2; ++part)
        EXPECT_EQ(run(fmt::format("--stage scene --part {}/2", part)).code, 0);
    EXPECT_FALSE(fs::exists(folder_ / "out" / "drives"));
    for (int part = 0; part < 2; ++part)
        EXPECT_EQ(run(fmt::format("--stage drive --part {}/2", part)).code, 0);
    EXPECT_EQ(report("-o " + path("whole"))["done"], 9);
    EXPECT_TRUE(published() == published("whole"));
}

TEST_F(CliRun, a_run_that_is_killed_goes_on_to_the_same_bytes)
{
    EXPECT_EQ(report("-o " + path("whole"))["done"], 9);
    std::mt19937 random(5);
    for (int i = 0; i < 8; ++i) {
        ChildProgram child(line());
        std::this_thread::sleep_for(std::chrono::milliseconds(150 + random() % 500));
        child.stop(i % 3 ? SIGKILL : SIGTERM);
    }
    EXPECT_EQ(run().code, 0);
    EXPECT_TRUE(published() == published("whole"));
    EXPECT_EQ(attempts(), 0u) << "what a dead process left is adopted or removed";
}

// an attempt in another's folder, as a machine that was lost leaves it
TEST_F(CliRun, what_another_attempt_has_finished_is_taken_over)
{
    const auto journal = [&]() -> size_t {
        for (const auto& entry : fs::recursive_directory_iterator(folder_ / "out" / ".work"))
            if (entry.path().filename() == "journal.jsonl")
                return size_t(std::ranges::count(contents(entry.path()), '\n'));
        return 0;
    };
    put_job("previous_noise = 0\n");
    fs::create_directories(folder_ / "out" / ".work");
    EXPECT_EQ(run("--stage scene").code, 0);
    {
        ChildProgram child(line("--stage drive"));
        while (child.running() && journal() < 2)
            std::this_thread::sleep_for(std::chrono::milliseconds(2));
        child.stop(SIGKILL);
    }
    if (attempts() == 0)
        GTEST_SKIP() << "it was done before it could be killed";
    EXPECT_EQ(run().code, 0);
    bool adopted = false;
    for (const char* scene : {"a", "b", "c"})
        for (const char* drive : {"ahead", "back"})
            adopted = adopted || manifest(fmt::format("drives/{}/{}", scene, drive))["adopted"] == true;
    EXPECT_TRUE(adopted);
    EXPECT_EQ(report("-o " + path("whole"))["done"], 9);
    EXPECT_TRUE(published() == published("whole"));
}

TEST_F(CliRun, of_two_at_once_one_is_published)
{
    std::vector<std::unique_ptr<ChildProgram>> children;
    for (int i = 0; i < 2; ++i)
        children.push_back(std::make_unique<ChildProgram>(line()));
    for (const auto& child : children) {
        while (child->running())
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
        EXPECT_EQ(child->stop(0), 0);
    }
    EXPECT_EQ(attempts(), 0u);
    EXPECT_EQ(report("-o " + path("whole"))["done"], 9);
    EXPECT_TRUE(published() == published("whole"));
}

TEST_F(CliRun, a_task_that_fails_leaves_the_others)
{
    folder_.put("scenes/b.sgrid", "no grid");
    const ProgramResult result = run();
    EXPECT_EQ(result.code, 7) << result.err;
    EXPECT_TRUE(fs::exists(folder_ / "out/drives/c/back/manifest.json"));
    EXPECT_FALSE(fs::exists(folder_ / "out/drives/b"));
    const ProgramResult status = run("--status");
    EXPECT_NE(status.out.find("scenes/b: failed, code 3 on "), std::string::npos) << status.out;
    EXPECT_NE(status.out.find("9 tasks: 6 done, 1 failed, 0 begun, 2 missing, 0 of other settings"), std::string::npos)
        << status.out;
    EXPECT_TRUE(write_grid(folder_ / "scenes/b.sgrid", labels(8)));
    EXPECT_EQ(report()["done"], 3);
    EXPECT_NE(run("--status").out.find("9 tasks: 9 done"), std::string::npos);
}

TEST_F(CliRun, other_settings_do_not_overwrite)
{
    EXPECT_EQ(run().code, 0);
    const auto before = published();
    put_job("seed_is_not_an_option_here = 1\n");
    EXPECT_EQ(run().code, 3);
    put_job("cfg_scale = 3\n");
    const ProgramResult refused = run();
    EXPECT_EQ(refused.code, 7);
    EXPECT_NE(refused.err.find("was made with other settings or inputs; -y moves it aside"), std::string::npos);
    EXPECT_TRUE(published() == before);
    EXPECT_EQ(report("-y")["done"], 6) << "drives; the scenes are the same";
    EXPECT_FALSE(published() == before);
}

TEST_F(CliRun, check_reads_every_byte)
{
    EXPECT_EQ(run().code, 0);
    EXPECT_EQ(run("--check --same-device").code, 0);
    const fs::path file = folder_ / "out/drives/a/ahead/frames/000001.png";
    std::string bytes = contents(file);
    bytes[bytes.size() / 2] ^= 1;
    std::ofstream(file) << bytes;
    const ProgramResult changed = run("--check");
    EXPECT_EQ(changed.code, 1);
    EXPECT_NE(changed.out.find("frames/000001.png' has other bytes"), std::string::npos) << changed.out;
    EXPECT_NE(changed.out.find("8 of 9 tasks"), std::string::npos) << changed.out;
}

TEST_F(CliRun, only_the_buffers_that_are_asked_for_are_kept)
{
    put_job("[output]\nbuffers = [\"depth\"]\nrefine = true\ncolor = \"jpeg:95\"\ndepth = \"cm\"\n");
    EXPECT_EQ(run().code, 0);
    const fs::path drive = folder_ / "out/drives/a/ahead";
    EXPECT_TRUE(fs::exists(drive / "frames/000002.jpg"));
    EXPECT_TRUE(fs::exists(drive / "buffers/depth/000002.png"));
    EXPECT_FALSE(fs::exists(drive / "buffers/label"));
    const Json cameras = Json::parse(contents(drive / "transforms.json"), nullptr, false);
    EXPECT_EQ(cameras["depth_unit_scale_factor"], 0.01);
    for (const Json& frame : cameras["frames"]) {
        EXPECT_TRUE(frame.contains("depth_file_path"));
        for (const auto& [key, value] : frame.items())
            EXPECT_TRUE(!key.ends_with("_path") || fs::exists(drive / value.get<std::string>())) << key;
    }
}

TEST_F(CliRun, a_drive_can_be_shards)
{
    put_job("[output]\nlayout = \"shards\"\nshard_bytes = \"64K\"\n");
    for (const char* output : {"out", "again"}) // the second in parts
        for (int part = 0; part < (output[0] == 'o' ? 1 : 3); ++part)
            EXPECT_EQ(run(fmt::format("-o {} --part {}/{}", path(output), part, output[0] == 'o' ? 1 : 3)).code, 0);
    EXPECT_TRUE(published("again") == published());
    const std::string set = path("out/drives/a/ahead");
    EXPECT_EQ(semrover_program("dataset verify --quiet " + set).code, 0);
    const ProgramResult unpacked = semrover_program("dataset unpack --quiet " + set + " -o " + path("unpacked"));
    EXPECT_EQ(unpacked.code, 0) << unpacked.err;
    put_job();
    EXPECT_EQ(run("-o " + path("folders")).code, 0);
    for (const auto& entry : fs::recursive_directory_iterator(folder_ / "folders/drives/a/ahead"))
        if (entry.is_regular_file() && entry.path().filename() != "manifest.json") {
            const fs::path name = entry.path().lexically_relative(folder_ / "folders/drives/a/ahead");
            EXPECT_TRUE(contents(entry.path()) == contents(folder_ / "unpacked" / name)) << name;
        }
}

TEST_F(CliRun, a_scene_that_has_points_is_drawn_as_it_is)
{
    EXPECT_TRUE(write_grid(folder_ / "street.sgrid", street()));
    folder_.put("draw.toml", "out = 'drawn'\n[[scene]]\npoints = 'street.sgrid'\n[[drive]]\npath = 'ahead.tum'\n"
                             "width = 56\nheight = 40\n");
    EXPECT_EQ(run("", "draw.toml").code, 0);
    EXPECT_TRUE(fs::exists(folder_ / "drawn/drives/street/drive/color/000002.png"));
    EXPECT_FALSE(fs::exists(folder_ / "drawn/scenes"));
    EXPECT_FALSE(fs::exists(folder_ / "drawn/drives/street/drive/run.json"));
}

// under a batch system, which wants a GPU unless it is told otherwise
TEST_F(CliRun, a_street_is_made_up_and_driven_through)
{
    folder_.put("made.toml", R"(out = "made"
model = "model"
[[scene]]
streets = {seeds = 5, length = 30, spacing = 6, seen = true, reach = 4}
[[drive]]
made = true
width = 56
height = 40
[generate]
steps = 1
)");
    setenv("SLURM_JOB_ID", "1", 1);
    const ProgramResult refused = run("", "made.toml");
    const ProgramResult made = run("--require any --max-vram 4GiB", "made.toml");
    unsetenv("SLURM_JOB_ID");
    EXPECT_EQ(refused.code, 4) << refused.err;
    EXPECT_EQ(made.code, 0) << made.err;
    for (const char* file : {"scenes/street-000005/scene.sgrid", "scenes/street-000005/street/objects.json",
                             "drives/street-000005/drive/color/000000.png"})
        EXPECT_TRUE(fs::exists(folder_ / "made" / file)) << file;
    EXPECT_FALSE(fs::exists(folder_ / "made/scenes/street-000005/street/mesh.glb"));
}

TEST_F(CliRun, json_is_the_same_job)
{
    folder_.put("job.json", R"({"name": "three", "out": "out", "model": "model", "seed": 7,
  "scene": [{"labels": "scenes/*.sgrid"}],
  "drive": [{"name": "ahead", "path": "ahead.tum", "width": 56, "height": 40},
            {"name": "back", "path": "back.tum", "width": 40, "height": 32}],
  "generate": {"steps": 2, "region_size": 24, "coverage_threshold": 6},
  "refine": {"steps": 2}})");
    EXPECT_EQ(run("--stage scene").code, 0);
    EXPECT_NE(run("--status", "job.json").out.find("9 tasks: 3 done, 0 failed, 0 begun, 6 missing"), std::string::npos);
}

TEST_F(CliRun, mistakes_are_said_with_line_and_column)
{
    const std::string good = contents(folder_ / "job.toml");
    const auto with = [&](std::string_view from, std::string_view to) {
        std::string text = good;
        text.replace(text.find(from), from.size(), to);
        return text;
    };
    const struct {
        std::string text;
        std::string_view said;
    } mistakes[] = {
        {with("labels =", "lables ="), "job.toml':6:1: unknown key 'lables'; is it 'labels'?"},
        {with("[refine]", "[refien]"), "job.toml':21:2: unknown key 'refien'; is it 'refine'?"},
        {with("steps = 2", "step = 2"), "job.toml':18:1: unknown key 'step'; is it 'steps'?"},
        {with("steps = 2", "steps = \"two\""),
         "job.toml':18:1: 'steps': expected an integer from 1 to 10000, found 'two'"},
        {with("steps = 2", "steps = 0"), "job.toml':18:1: 'steps': expected an integer from 1 to 10000, found '0'"},
        {with("steps = 2", "steps = 2.5"), "job.toml':18:1: 'steps': expected an integer from 1 to 10000, found '2.5'"},
        {with("steps = 2", "steps = 1979-05-27"), "job.toml':18:9: a date or time has no meaning in a job"},
        {with("steps = 2", "steps = 2\nsteps = 3"), "job.toml':19:"},
        {with("seed = 7", "seed = -7"), "job.toml':4:1: 'seed': expected an integer from 0, found '-7'"},
        {with("seed = 7", "seed = [7]"), "job.toml':4:1: 'seed': expected an integer from 0, found a list"},
        {with("model = \"model\"", "model = \"nowhere\""), "job.toml':3:1: 'model': '"},
        {with("model = \"model\"\n", ""), "job.toml':4:1: a scene that is generated needs a 'model'"},
        {with("scenes/*.sgrid", "scenes/*.none"), "job.toml':6:1: 'labels': no file is '"},
        {with("labels = \"scenes/*.sgrid\"", "name = \"x\"\nlabels = \"scenes/*.sgrid\""),
         "job.toml':6:1: 'name': 3 files have one name"},
        {with("[[drive]]", "[[scene]]\nlabels = \"scenes/a.sgrid\"\n[[drive]]"),
         "job.toml':8:1: two scenes have the name 'a'"},
        {with("name = \"back\"", "name = \"ahead\""), "two drives have the name 'ahead'"},
        {with("name = \"back\"", "name = \"../back\""), "'../back': a drive's name is of letters"},
        {with("ahead.tum", "behind.tum"), "job.toml':9:1: 'path': '"},
        {with("path = \"ahead.tum\"", "made = true"), "job.toml':9:1: 'made': scene 'a' is no street"},
        {with("path = \"ahead.tum\"", "path = \"ahead.tum\"\nscenes = \"x*\""), "'scenes': no scene is 'x*'"},
        {with("path = \"ahead.tum\"", "path = \"ahead.tum\"\nrig = \"none.json\""), "job.toml':10:1: 'rig': '"},
        {with("width = 56", "widht = 56"), "job.toml':10:1: unknown key 'widht'; is it 'width'?"},
        {with("[refine]", "[render]\n[refine]"), "job.toml':21:2: 'render' and 'refine'"},
        {with("[refine]", "[output]\nlayout = \"zip\"\n[refine]"),
         "job.toml':22:1: 'layout': expected folder or shards, found 'zip'"},
        {with("[refine]", "[output]\nbuffers = [\"colour\"]\n[refine]"), "'buffers': expected color, depth"},
        {with("steps = 2", "steps = 2\ntile_size = 9.6\norder = \"rows\""),
         "job.toml':20:1: 'order': expected scene, tiles, found 'rows'"},
        {with("seed = 7", "seed = "), "job.toml':4:"},
        {"[[scene", "job.toml':1:"},
    };
    for (const auto& m : mistakes) {
        folder_.put("job.toml", m.text);
        const ProgramResult result = run("--list");
        EXPECT_EQ(result.code, 3) << m.said << "\n" << result.err;
        EXPECT_NE(result.err.find(m.said), std::string::npos) << m.said << "\n" << result.err;
        EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << result.err;
    }
}

TEST_F(CliRun, mistakes_in_json_are_said_with_line_and_column)
{
    const struct {
        const char* text;
        std::string_view said;
    } mistakes[] = {
        {"{\"out\": \"o\",\n \"modle\": \"model\"}", "bad.json':2:2: unknown key 'modle'; is it 'model'?"},
        {"{\"out\": \"o\", \"model\": null}", "bad.json':1: null has no meaning in a job"},
        {"{\"out\": \"o\",\n \"scene\": [\n  {\"points\": 7}]}", "bad.json':3:4: 'points': expected a text, found '7'"},
        {"{\"out\": \"o\", \"out\": \"p\"}", "bad.json'"},
        {"[1]", "bad.json': expected a table, found a list"},
        {"{\"out\": ", "bad.json'"},
    };
    for (const auto& m : mistakes) {
        folder_.put("bad.json", m.text);
        const ProgramResult result = run("--list", "bad.json");
        EXPECT_EQ(result.code, 3) << m.text;
        EXPECT_NE(result.err.find(m.said), std::string::npos) << result.err;
    }
}

TEST_F(CliRun, ten_thousand_tasks_are_listed)
{
    folder_.put("many.toml", "out = 'many'\nmodel = 'model'\n[[scene]]\nstreets = {seeds = \"1..5000\", length = 40}\n"
                             "[[drive]]\nmade = true\n");
    const ProgramResult list = run("--list --json", "many.toml");
    EXPECT_EQ(list.code, 0) << list.err;
    EXPECT_EQ(std::ranges::count(list.out, '\n'), 10000);
    EXPECT_EQ(run("--parts", "many.toml").out, "1000\n");
    EXPECT_EQ(run("--parts --most 64", "many.toml").out, "64\n");
    size_t tasks = 0;
    for (const int part : {0, 499, 999}) // 5 scenes and their drives each
        tasks += size_t(std::ranges::count(run(fmt::format("--list --part {}/1000", part), "many.toml").out, '\n'));
    EXPECT_EQ(tasks, 30u);
}

} // namespace cli_run_test
} // namespace semrover
