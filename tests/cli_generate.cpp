// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/scene/grid.h"
#include "runtime/base/json.h"
#include "runtime/base/safetensors.h"
#include "tests/support/child_program.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"

#include <algorithm>
#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <fstream>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

namespace semrover {
namespace cli_generate_test {

using Json = nlohmann::json;

// a model's component with two layers; it stands for a whole model, with the method's own scheduler
const std::string kModel = SEMROVER_SOURCE_DIR "/tests/golden/sampling_ddpm/model";
constexpr const char* kSettings = " --steps 2 --region-size 48 --coverage-threshold 12 ";

// 300 voxels: a road of 12 x 20 and a facade beside it
VoxelGrid street()
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    for (int32_t i = 0; i < 20; ++i) {
        for (int32_t j = 0; j < 12; ++j)
            grid.cells.push_back({i, j, 0});
        for (int32_t k = 1; k < 4; ++k)
            grid.cells.push_back({i, 11, k});
    }
    for (const Cell& cell : grid.cells)
        grid.labels.push_back(cell[2] ? 2 : 0);
    sort_cells(grid);
    return grid;
}

size_t files_in(const Path& folder)
{
    std::error_code ignored;
    const std::filesystem::directory_iterator files(folder, ignored);
    return size_t(std::distance(begin(files), end(files)));
}

// as a process that works there
int hold_lock(const Path& folder)
{
    std::filesystem::create_directories(folder);
    const int lock = ::open((folder / "lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    EXPECT_EQ(::flock(lock, LOCK_EX | LOCK_NB), 0);
    return lock;
}

class CliGenerate : public testing::Test {
  protected:
    CliGenerate() { EXPECT_TRUE(write_grid(folder_ / "in.sgrid", street())); }

    std::string path(std::string_view name) const { return (folder_ / name).string(); }
    std::string arguments(std::string_view output, std::string_view input = "in.sgrid") const
    {
        return "generate " + path(input) + " -m " + kModel + " -o " + path(output) + " --quiet" + kSettings;
    }
    ProgramResult generate(std::string_view output, const std::string& more = "",
                           std::string_view input = "in.sgrid") const
    {
        return semrover_program(arguments(output, input) + more);
    }
    std::string bytes_of(std::string_view output, const std::string& more = "") const
    {
        const ProgramResult result = generate(output, more);
        EXPECT_EQ(result.code, 0) << result.err;
        return contents(path(output));
    }
    size_t journal_lines(std::string_view output) const
    {
        const std::string journal = contents(path(std::string(output) + ".run/journal.jsonl"));
        return size_t(std::ranges::count(journal, '\n'));
    }
    // starts a run, waits until `lines` regions are saved and sends it `signal`; its exit status
    int stop_after(std::string_view output, size_t lines, int signal) const
    {
        ChildProgram child(arguments(output) + "--batch 1");
        while (journal_lines(output) < lines && child.running())
            usleep(500);
        return child.stop(signal);
    }

    ScratchFolder folder_;
};

TEST_F(CliGenerate, any_batch_and_a_second_run_give_the_same_bytes)
{
    const std::string first = bytes_of("a.sgrid", "--batch 1");
    ASSERT_FALSE(first.empty());
    EXPECT_TRUE(first == bytes_of("b.sgrid", "--batch 1"));
    EXPECT_TRUE(first == bytes_of("c.sgrid", "--batch 3"));
    EXPECT_TRUE(first == bytes_of("d.sgrid", "--batch 8"));
    EXPECT_FALSE(first == bytes_of("e.sgrid", "--seed 8"));
    const auto grid = read_grid(path("a.sgrid"));
    ASSERT_TRUE(grid) << grid.error().message;
    EXPECT_EQ(grid->cells.size(), 300u);
    EXPECT_EQ(std::ranges::count(grid->generated, 1), 300);
    EXPECT_EQ(grid->labels, street().labels);
}

TEST_F(CliGenerate, in_the_order_of_tiles_a_part_killed_runs_and_batches_give_the_bytes_of_the_whole)
{
    const std::string tiles = "--order tiles --tile-size 3.6 ";
    const std::string first = bytes_of("a.sgrid", tiles + "--batch 1");
    EXPECT_TRUE(first == bytes_of("b.sgrid", tiles + "--batch 4"));
    EXPECT_FALSE(first == bytes_of("c.sgrid", "--order scene"));
    EXPECT_FALSE(first == bytes_of("d.sgrid", "--order tiles --tile-size 4.2"));
    ChildProgram child(arguments("e.sgrid") + tiles + "--batch 1");
    while (files_in(path("e.sgrid.run/tiles")) < 3 && child.running())
        usleep(500);
    child.stop(SIGKILL);
    EXPECT_FALSE(std::filesystem::exists(path("e.sgrid")));
    EXPECT_TRUE(first == bytes_of("e.sgrid", tiles));
    EXPECT_FALSE(std::filesystem::exists(path("e.sgrid.run/tiles")));
    VoxelGrid part; // tiles 0 and 1 along i, of which tile 0 has all its neighbours
    part.voxel_size = 0.6f;
    for (size_t c = 0; c < street().cells.size(); ++c)
        if (street().cells[c][0] < 12)
            append_cell(part, street(), c);
    ASSERT_TRUE(write_grid(path("part.sgrid"), part));
    ASSERT_EQ(generate("f.sgrid", tiles, "part.sgrid").code, 0);
    const auto whole = read_grid(path("a.sgrid")), cut = read_grid(path("f.sgrid"));
    ASSERT_TRUE(whole && cut);
    EXPECT_EQ(cut->metadata.at("tile_cells"), "6");
    const size_t values = size_t(std::ranges::count_if(cut->cells, [](const Cell& c) { return c[0] < 6; })) * 60;
    EXPECT_GT(values, 60u * 80);
    EXPECT_TRUE(std::equal(cut->points.begin(), cut->points.begin() + ptrdiff_t(values), whole->points.begin()));
    EXPECT_TRUE(std::equal(cut->colors.begin(), cut->colors.begin() + ptrdiff_t(values), whole->colors.begin()));
}

TEST_F(CliGenerate, the_model_says_how_known_cells_are_seen_and_an_option_says_otherwise)
{
    std::filesystem::create_directory(folder_ / "model");
    std::filesystem::copy(kModel, folder_ / "model/voxfield_transformer");
    const auto bytes = [&](std::string_view output, const std::string& defaults, const std::string& more = "") {
        std::ofstream(folder_ / "model/model_index.json") << R"({"defaults": {)" + defaults + "}}";
        const ProgramResult result = semrover_program("generate " + path("in.sgrid") + " -m " + path("model") + " -o " +
                                                      path(output) + " --quiet" + kSettings + more);
        EXPECT_EQ(result.code, 0) << result.err;
        return contents(path(output));
    };
    const std::string noised = bytes("a.sgrid", ""), clean = bytes("b.sgrid", R"("known_tokens": "clean")");
    EXPECT_TRUE(noised != clean);
    EXPECT_TRUE(noised == bytes("c.sgrid", R"("known_tokens": "clean")", "--known-tokens noised"));
    EXPECT_TRUE(clean == bytes("d.sgrid", R"("known_tokens": "noised")", "--known-tokens clean"));
    EXPECT_TRUE(clean != bytes("e.sgrid", R"("known_tokens": "clean")", "--jump-length 1 --jump-n-sample 2"));
    EXPECT_EQ(bytes("f.sgrid", R"("known_tokens": "clean")", "--jump-length 1 --jump-n-sample 2 --batch 4"),
              contents(path("e.sgrid")));
}

TEST_F(CliGenerate, a_run_that_was_killed_goes_on_to_the_same_bytes)
{
    const std::string whole = bytes_of("whole.sgrid");
    for (const size_t lines : {0, 1, 2, 4}) {
        const std::string output = fmt::format("killed{}.sgrid", lines);
        EXPECT_EQ(stop_after(output, lines, SIGKILL), 128 + SIGKILL) << lines;
        EXPECT_FALSE(std::filesystem::exists(path(output)));
        EXPECT_TRUE(whole == bytes_of(output, "--batch 2")) << "killed after " << lines << " regions";
    }
}

TEST_F(CliGenerate, a_run_killed_again_and_again_ends_with_the_same_bytes)
{
    const std::string whole = bytes_of("whole.sgrid");
    for (size_t lines = 1; lines < 6; ++lines)
        EXPECT_EQ(stop_after("often.sgrid", lines, SIGKILL), 128 + SIGKILL);
    EXPECT_TRUE(whole == bytes_of("often.sgrid"));
}

TEST_F(CliGenerate, a_run_killed_while_it_writes_the_grid_loses_nothing)
{
    const std::string whole = bytes_of("whole.sgrid");
    const size_t regions = journal_lines("whole.sgrid");
    for (int i = 0; i < 3; ++i) {
        const std::string output = fmt::format("late{}.sgrid", i);
        stop_after(output, regions, SIGKILL); // some are through before the signal comes
        if (std::filesystem::exists(path(output))) {
            EXPECT_TRUE(whole == contents(path(output)));
        }
        const Json report = json_of(generate(output, "-y --json").out);
        EXPECT_TRUE(whole == contents(path(output)));
        EXPECT_EQ(report["planned_device_bytes"], report["peak_device_bytes"]);
    }
}

TEST_F(CliGenerate, a_finished_run_whose_grid_was_removed_is_made_again)
{
    const std::string whole = bytes_of("out.sgrid");
    const size_t regions = journal_lines("out.sgrid");
    std::filesystem::remove(path("out.sgrid"));
    EXPECT_TRUE(whole == bytes_of("out.sgrid"));
    EXPECT_EQ(journal_lines("out.sgrid"), regions);
}

TEST_F(CliGenerate, damaged_state_is_done_again)
{
    const std::string whole = bytes_of("whole.sgrid");
    ASSERT_EQ(stop_after("out.sgrid", 4, SIGKILL), 128 + SIGKILL);
    std::ofstream(path("out.sgrid.run/journal.jsonl"), std::ios::app) << R"({"region":5,"ce)"; // died while writing
    for (const auto& entry : std::filesystem::directory_iterator(path("out.sgrid.run/regions"))) {
        std::filesystem::resize_file(entry.path(), 40);
        break;
    }
    EXPECT_TRUE(whole == bytes_of("out.sgrid"));
}

TEST_F(CliGenerate, an_interrupt_saves_what_is_done_and_exits_with_130)
{
    EXPECT_EQ(stop_after("out.sgrid", 2, SIGINT), 130);
    EXPECT_FALSE(std::filesystem::exists(path("out.sgrid")));
    EXPECT_GE(journal_lines("out.sgrid"), 2u);
    EXPECT_TRUE(bytes_of("whole.sgrid") == bytes_of("out.sgrid"));
}

TEST_F(CliGenerate, a_run_whose_device_is_lost_goes_on_with_a_new_one)
{
    const std::string whole = bytes_of("whole.sgrid");
    const std::string arguments_lost =
        "generate " + path("in.sgrid") + " -m " + kModel + " -o " + path("lost.sgrid") + kSettings + "--batch 1";
    const ProgramResult twice = semrover_with_lost_devices(2, 8, arguments_lost);
    EXPECT_EQ(twice.code, 0) << twice.err;
    EXPECT_NE(twice.err.find("going on with a new device"), std::string::npos) << twice.err;
    EXPECT_TRUE(whole == contents(path("lost.sgrid")));
    const ProgramResult always = semrover_with_lost_devices(1000, 8, arguments("always.sgrid"));
    EXPECT_EQ(always.code, 6) << always.err;
    EXPECT_NE(always.err.find("VK_ERROR_DEVICE_LOST"), std::string::npos) << always.err;
    EXPECT_FALSE(std::filesystem::exists(path("always.sgrid")));
}

TEST_F(CliGenerate, known_cells_stay_as_they_are)
{
    bytes_of("whole.sgrid", "--seed 3");
    auto grid = read_grid(path("whole.sgrid"));
    ASSERT_TRUE(grid);
    const VoxelGrid before = *grid;
    const size_t per_cell = size_t(grid->points_per_voxel) * 3;
    for (size_t i = 0; i < grid->cells.size(); ++i)
        if (grid->cells[i][0] >= 10) {
            grid->generated[i] = 0;
            std::fill_n(&grid->points[i * per_cell], per_cell, uint16_t(0));
        }
    ASSERT_TRUE(write_grid(path("half.sgrid"), *grid));
    const ProgramResult result = generate("out.sgrid", "--json", "half.sgrid");
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_EQ(json_of(result.out)["cells"], 150);
    const auto after = read_grid(path("out.sgrid"));
    ASSERT_TRUE(after);
    size_t changed = 0;
    for (size_t i = 0; i < before.cells.size(); ++i) {
        const bool same = std::equal(&before.points[i * per_cell], &before.points[i * per_cell] + per_cell,
                                     &after->points[i * per_cell]) &&
                          std::equal(&before.colors[i * per_cell], &before.colors[i * per_cell] + per_cell,
                                     &after->colors[i * per_cell]);
        if (before.cells[i][0] < 10)
            EXPECT_TRUE(same) << "voxel " << i;
        else
            changed += !same;
    }
    EXPECT_EQ(changed, 150u);
}

TEST_F(CliGenerate, a_finished_run_is_done)
{
    const std::string first = bytes_of("out.sgrid"), run = contents(path("out.sgrid.run/run.json"));
    const ProgramResult again = generate("out.sgrid", "--json");
    EXPECT_EQ(again.code, 0) << again.err;
    EXPECT_EQ(json_of(again.out), json_of(run)["results"]);
    EXPECT_TRUE(first == contents(path("out.sgrid")));
    EXPECT_EQ(run, contents(path("out.sgrid.run/run.json")));
    // not what the run wrote any more
    std::ofstream(path("out.sgrid"), std::ios::app) << "x";
    expect_error(generate("out.sgrid"), 2, "-y replaces it");
}

TEST_F(CliGenerate, an_existing_output_needs_yes)
{
    const std::string first = bytes_of("out.sgrid");
    const ProgramResult refused = generate("out.sgrid", "--seed 9");
    EXPECT_EQ(refused.code, 2);
    EXPECT_NE(refused.err.find("-y replaces it"), std::string::npos) << refused.err;
    EXPECT_TRUE(first == contents(path("out.sgrid")));
    EXPECT_FALSE(first == bytes_of("out.sgrid", "--seed 9 -y"));
}

TEST_F(CliGenerate, state_of_other_settings_is_refused_without_yes)
{
    ASSERT_EQ(stop_after("out.sgrid", 1, SIGKILL), 128 + SIGKILL);
    const ProgramResult refused = generate("out.sgrid", "--seed 8");
    EXPECT_EQ(refused.code, 3);
    EXPECT_NE(refused.err.find("other settings"), std::string::npos) << refused.err;
    EXPECT_TRUE(bytes_of("out.sgrid", "--seed 8 -y") == bytes_of("other.sgrid", "--seed 8"));
}

// with another one a run would go on to bytes of neither
TEST_F(CliGenerate, state_of_another_scheduler_or_of_other_kernels_is_refused_without_yes)
{
    std::filesystem::create_directory(folder_ / "model");
    std::filesystem::copy(kModel, folder_ / "model/voxfield_transformer");
    std::filesystem::create_directory(folder_ / "model/voxfield_scheduler");
    const auto put_scheduler = [&](double end) {
        folder_.put("model/voxfield_scheduler/scheduler_config.json",
                    Json{{"_class_name", "DDPMScheduler"}, {"beta_end", end}, {"prediction_type", "sample"}}.dump());
    };
    put_scheduler(0.02);
    const std::string line = "generate " + path("in.sgrid") + " -m " + path("model") + " -o " + path("out.sgrid") +
                             " --quiet --batch 1" + kSettings;
    ChildProgram child(line);
    while (journal_lines("out.sgrid") < 1 && child.running())
        usleep(500);
    ASSERT_EQ(child.stop(SIGKILL), 128 + SIGKILL);
    const auto refused = [&] {
        expect_error(semrover_program(line), 3, "holds a run with other settings, model, input or device");
    };
    put_scheduler(0.019);
    refused();
    put_scheduler(0.02);
    ASSERT_EQ(setenv("SEMROVER_LIMITS", "variant=simt", 1), 0);
    refused();
    ASSERT_EQ(unsetenv("SEMROVER_LIMITS"), 0);
    EXPECT_EQ(semrover_program(line).code, 0);
}

TEST_F(CliGenerate, a_dry_run_writes_nothing_and_says_what_a_run_would_take)
{
    const size_t entries = folder_.entries();
    const ProgramResult result =
        semrover_program("generate " + path("in.sgrid") + " -m " + kModel + kSettings + "--dry-run --json");
    ASSERT_EQ(result.code, 0) << result.err;
    const Json report = json_of(result.out);
    EXPECT_EQ(report["cells"], 300);
    EXPECT_EQ(report["steps"], 2);
    EXPECT_GT(report["regions"], 5);
    EXPECT_GT(report["seconds"], 0);
    EXPECT_EQ(folder_.entries(), entries);
    const Json run = json_of(generate("out.sgrid", "--json").out);
    EXPECT_EQ(report["peak_device_bytes"], run["peak_device_bytes"]);
    EXPECT_EQ(report["regions"], run["regions"]);
}

TEST_F(CliGenerate, the_planned_memory_is_the_memory_that_was_used)
{
    for (const char* more : {"--batch 1", "--batch 3", "--batch 8", "--batch 64", "--batch 2 --precision fp32",
                             "--batch 2 --cfg-scale 1"}) {
        const ProgramResult result = generate("out.sgrid", fmt::format("--json -y {}", more));
        ASSERT_EQ(result.code, 0) << result.err;
        const Json report = json_of(result.out);
        EXPECT_EQ(report["planned_device_bytes"], report["peak_device_bytes"]) << more;
    }
    ASSERT_EQ(stop_after("resumed.sgrid", 4, SIGKILL), 128 + SIGKILL);
    const Json report = json_of(generate("resumed.sgrid", "--json --batch 8").out);
    EXPECT_EQ(report["planned_device_bytes"], report["peak_device_bytes"]);
}

TEST_F(CliGenerate, a_budget_makes_batches_smaller_and_the_bytes_stay)
{
    const Json one = json_of(generate("one.sgrid", "--json --batch 1").out);
    const uint64_t bytes = one["peak_device_bytes"];
    const ProgramResult result = generate("small.sgrid", fmt::format("--json --batch 8 --max-vram {}", bytes));
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_EQ(json_of(result.out)["peak_device_bytes"], bytes);
    EXPECT_TRUE(contents(path("one.sgrid")) == contents(path("small.sgrid")));
    EXPECT_EQ(generate("less.sgrid", fmt::format("--batch 8 --max-vram {}", bytes - 1)).code, 5);
    EXPECT_EQ(generate("", fmt::format("--dry-run --max-vram {}", bytes)).code, 0);
}

TEST_F(CliGenerate, a_folder_where_another_process_works_is_busy)
{
    const int lock = hold_lock(path("out.sgrid.run"));
    const ProgramResult busy = generate("out.sgrid");
    ::close(lock);
    EXPECT_EQ(busy.code, 75);
    EXPECT_NE(busy.err.find("another process works in"), std::string::npos) << busy.err;
    EXPECT_EQ(generate("out.sgrid").code, 0);
}

// ---- bad input: one line, the exit code, nothing left behind

using Tensors = std::vector<TensorData>;

class CliGenerateRefuses : public CliGenerate {
  protected:
    // the tiny model with its tensors changed
    std::string model(const std::function<void(Tensors&)>& change)
    {
        const std::filesystem::path folder = folder_ / fmt::format("model{}", models_++);
        std::filesystem::copy(kModel, folder);
        const std::filesystem::path weights = folder / "diffusion_pytorch_model.safetensors";
        const auto file = Safetensors::open(weights);
        Tensors tensors;
        for (const TensorInfo& t : file->tensors())
            tensors.push_back({t.name, t.dtype, t.shape, file->bytes(t)});
        change(tensors);
        EXPECT_TRUE(write_safetensors(folder / "changed", tensors));
        std::filesystem::rename(folder / "changed", weights);
        return folder.string();
    }
    // a grid that write_grid would refuse
    std::string grid(const std::vector<Cell>& cells, uint8_t label, uint16_t point)
    {
        const uint64_t v = cells.size();
        const std::vector<uint8_t> labels(v, label), colors(v * 60), generated(v, 1);
        const std::vector<uint16_t> points(v * 60, point);
        const TensorData tensors[] = {{"cells", DType::i32, {v, 3}, std::as_bytes(std::span(cells))},
                                      {"labels", DType::u8, {v}, std::as_bytes(std::span(labels))},
                                      {"points", DType::f16, {v, 20, 3}, std::as_bytes(std::span(points))},
                                      {"colors", DType::u8, {v, 20, 3}, std::as_bytes(std::span(colors))},
                                      {"generated", DType::u8, {v}, std::as_bytes(std::span(generated))}};
        const std::string file = path(fmt::format("bad{}.sgrid", models_++));
        EXPECT_TRUE(write_safetensors(file, tensors, {{"voxel_size", "0.6"}, {"points_per_voxel", "20"}}));
        return file;
    }
    void expect_refusal(const std::string& line, int code, std::string_view text)
    {
        const size_t entries = folder_.entries();
        const ProgramResult result = semrover_program(line);
        EXPECT_EQ(result.code, code) << line;
        EXPECT_TRUE(result.err.starts_with("semrover: error: ")) << result.err;
        EXPECT_NE(result.err.find(text), std::string::npos) << "expected \"" << text << "\", found: " << result.err;
        EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << result.err;
        EXPECT_EQ(result.out, "");
        EXPECT_EQ(folder_.entries(), entries) << line << ": something was left behind";
    }
    std::string with_model(const std::string& model) const
    {
        return "generate " + path("in.sgrid") + " -o " + path("out.sgrid") + " -m " + model;
    }
    std::string with_grid(const std::string& grid) const
    {
        return "generate " + grid + " -o " + path("out.sgrid") + " -m " + kModel;
    }

    int models_ = 0;
};

TEST_F(CliGenerateRefuses, models_that_are_not_whole)
{
    expect_refusal(with_model(model(
                       [](Tensors& t) { std::erase_if(t, [](const auto& x) { return x.name == "proj_in.weight"; }); })),
                   3, "proj_in.weight [64, 120]");
    expect_refusal(with_model(model([](Tensors& t) {
                       for (TensorData& x : t)
                           if (x.name == "proj_in.weight")
                               std::swap(x.shape[0], x.shape[1]);
                   })),
                   3, "proj_in.weight");
    std::vector<uint16_t> nan;
    expect_refusal(with_model(model([&](Tensors& t) {
                       for (TensorData& x : t)
                           if (x.name == "proj_out.weight") {
                               nan.resize(x.bytes.size() / 2);
                               std::memcpy(nan.data(), x.bytes.data(), x.bytes.size());
                               nan[5] = 0x7e00;
                               x.bytes = std::as_bytes(std::span(nan));
                           }
                   })),
                   3, "proj_out.weight");
    const std::string cut = model([](Tensors&) {});
    const std::filesystem::path weights = std::filesystem::path(cut) / "diffusion_pytorch_model.safetensors";
    std::filesystem::resize_file(weights, std::filesystem::file_size(weights) - 100);
    expect_refusal(with_model(cut), 3, "diffusion_pytorch_model.safetensors");
    std::filesystem::create_directory(folder_ / "empty");
    expect_refusal(with_model(path("empty")), 3, "voxfield_transformer/config.json");
    expect_refusal(with_model(path("nowhere")), 3, "voxfield_transformer/config.json");
}

TEST_F(CliGenerateRefuses, grids_that_are_not_sound)
{
    expect_refusal(with_grid(grid({}, 0, 0)), 3, "empty");
    expect_refusal(with_grid(grid({{0, 0, 0}}, 200, 0)), 3, "unknown labels, expected 0 to 19: 200 (1 voxels)");
    expect_refusal(with_grid(grid({{0, 0, 0}}, 0, 0x7e00)), 3, "nan");
    expect_refusal(with_grid(path("none.sgrid")), 3, "No such file");
    VoxelGrid coarse = street();
    coarse.voxel_size = 1.2f;
    ASSERT_TRUE(write_grid(path("coarse.sgrid"), coarse));
    expect_refusal(with_grid(path("coarse.sgrid")), 3, "1.2 m");
}

TEST_F(CliGenerateRefuses, outputs_that_cannot_be_written)
{
    const std::string line = "generate " + path("in.sgrid") + " -m " + kModel + kSettings;
    expect_refusal(line, 2, "-o/--output is required");
    expect_refusal(line + "-o " + path("in.sgrid/out.sgrid"), 3, "in.sgrid");
    expect_refusal(line + "-o " + path("no/such/folder/out.sgrid"), 3, "no/such/folder");
    expect_refusal(line + "-o /proc/out.sgrid", 3, "/proc");
    expect_refusal(line + "-o " + path("out.sgrid") + " --ply-3dgs " + path("no/out.ply"), 3, "no/out.ply");
    expect_refusal(line + "-y -o " + folder_.path().string(), 3, folder_.path().string());
    EXPECT_FALSE(std::filesystem::exists(folder_.path().string() + ".run"));
}

TEST_F(CliGenerateRefuses, devices_and_options_that_cannot_be)
{
    const std::string line = with_model(kModel) + " ";
    expect_refusal(line + "--max-vram 100KiB", 5, "--max-vram");
    expect_refusal(line + "--max-vram 600KiB", 5, "--max-vram");
    expect_refusal(line + "--device unobtainium", 4, "unobtainium");
    expect_refusal(line + "--sampler heun", 2, "heun");
    expect_refusal(line + "--preset slow", 2, "slow");
    expect_refusal(line + "--known-tokens fuzzy", 2, "fuzzy");
    expect_refusal(line + "--steps 0", 2, "--steps");
    expect_refusal(line + "--batch 0", 2, "batch");
    expect_refusal(line + "--cfg-scale=-1", 2, "--cfg-scale");
    expect_refusal(line + "--region-size 0", 2, "--region-size");
    expect_refusal(line + "--first-cell 300", 3, "first");
    expect_refusal(line + "--order spiral", 2, "spiral");
    expect_refusal(line + "--tile-size 4.8", 2, "--order tiles");
    expect_refusal(line + "--order tiles --first-cell 3", 2, "--first-cell");
    expect_refusal(line + "--order tiles --tile-size 2.4", 2, "narrower than its halo");
    expect_refusal(line + "--order tiles --strategy paper", 2, "leaves voxels empty");
    expect_refusal(line + "--order tiles --along " + path("in.sgrid"), 2, "--order");
}

} // namespace cli_generate_test
} // namespace semrover
