// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
// every command ends soon after a signal, with code 130 and nothing half-written. tools/dev/signals measures more
// moments.
#include "tests/support/child_program.h"
#include "tests/support/program.h"

#include <chrono>
#include <cstdlib>
#include <thread>

namespace semrover {
namespace cli_signals_test {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

const std::string kRoot = std::string(SEMROVER_SOURCE_DIR);

struct Stopped {
    int code;
    double seconds; // from the signal to the end
};

Stopped stop_after(double seconds, const std::string& arguments, int signal)
{
    ChildProgram child(arguments);
    std::this_thread::sleep_for(Seconds(seconds));
    EXPECT_TRUE(child.running()) << arguments << " ended before " << seconds << " s";
    const auto sent = Clock::now();
    const int code = child.stop(signal);
    return {code, Seconds(Clock::now() - sent).count()};
}

// what is left under a name of ours
std::vector<std::string> leftovers(const std::filesystem::path& folder)
{
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
        if (entry.path().filename().string().starts_with(".semrover-"))
            names.push_back(entry.path().string());
    return names;
}

class CliSignals : public testing::Test {
  protected:
    // each compiles its shaders anew
    CliSignals() { setenv("XDG_CACHE_HOME", (folder_ / "cache").c_str(), 1); }
    ~CliSignals() override { unsetenv("XDG_CACHE_HOME"); }

    void expect_stop(const std::string& arguments)
    {
        int signal = SIGINT;
        for (const double moment : {0.2, 0.7, 1.5}) {
            std::filesystem::remove_all(folder_ / "cache");
            const Stopped stopped = stop_after(moment, arguments, signal);
            EXPECT_EQ(stopped.code, 130) << arguments << " after " << moment << " s";
            EXPECT_LT(stopped.seconds, 2) << arguments << " after " << moment << " s";
            EXPECT_EQ(leftovers(folder_.path()), std::vector<std::string>()) << arguments;
            signal = SIGTERM;
        }
    }

    ScratchFolder folder_;
};

// hills of 3 million square metres: a minute of work, and less than the limit of their pieces
std::string large_mesh(const ScratchFolder& folder)
{
    std::string text = "usemtl road\n";
    for (int i = 0; i <= 180; ++i)
        for (int j = 0; j <= 180; ++j)
            text +=
                "v " + std::to_string(i * 10) + " " + std::to_string(j * 10) + " " + std::to_string(i * j % 7) + "\n";
    for (int i = 0; i < 180; ++i)
        for (int j = 1; j <= 180; ++j) {
            const int a = i * 181 + j;
            text += "f " + std::to_string(a) + " " + std::to_string(a + 181) + " " + std::to_string(a + 182) + " " +
                    std::to_string(a + 1) + "\n";
        }
    return folder.put("hills.obj", text).string();
}

TEST_F(CliSignals, voxelize_stops)
{
    expect_stop("voxelize " + large_mesh(folder_) + " --voxel-size 0.5 -o " + (folder_ / "out.sgrid").string());
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out.sgrid"));
}

TEST_F(CliSignals, streets_stop)
{
    expect_stop("streets --length 3000 --seen --images -o " + (folder_ / "out").string());
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
}

TEST_F(CliSignals, bench_stops)
{
    expect_stop("bench unet -W 77 -H 53");
}

TEST_F(CliSignals, verify_stops)
{
    expect_stop("verify " + kRoot + "/tests/golden");
}

TEST_F(CliSignals, generate_stops_and_goes_on_later)
{
    const std::string out = (folder_ / "out.sgrid").string();
    expect_stop("generate " + kRoot + "/assets/scenes/street.semantic.sgrid -m " + kRoot +
                "/assets/model --steps 500 -o " + out);
    EXPECT_FALSE(std::filesystem::exists(out));
}

TEST_F(CliSignals, a_second_signal_ends_at_once)
{
    ChildProgram child("bench unet -W 77 -H 53");
    std::this_thread::sleep_for(Seconds(0.7));
    ASSERT_TRUE(child.running());
    child.send(SIGINT);
    std::this_thread::sleep_for(Seconds(0.1)); // two at once are one
    const auto sent = Clock::now();
    EXPECT_EQ(child.stop(SIGINT), 130);
    EXPECT_LT(Seconds(Clock::now() - sent).count(), 1);
}

} // namespace cli_signals_test
} // namespace semrover
