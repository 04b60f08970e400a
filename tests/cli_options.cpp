// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
// every option of every subcommand, as the program lists them, with values that mean nothing
#include "runtime/base/json.h"
#include "tests/support/program.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>

namespace semrover {
namespace cli_options_test {

// Each option gets three of these, and each of these a third of the options, which share a few readers.
std::vector<std::string> bad_values()
{
    static const std::vector<std::string> all = {"nan",   "-nan", "inf",   "-inf",  "-1",
                                                 "1e300", "''",   "'1 2'", "12abc", "99999999999999999999"};
    static size_t next = 0;
    std::vector<std::string> some;
    for (int i = 0; i < 3; ++i)
        some.push_back(all[next++ % all.size()]);
    return some;
}

const std::string kAssets = std::string(SEMROVER_SOURCE_DIR) + "/assets/";
const std::string kGrid = kAssets + "scenes/street.semantic.sgrid", kPath = kAssets + "scenes/street.tum";

// a command line that is in order and, with nothing wrong added to it, would go on to work
std::string base_of(const std::string& command, const ScratchFolder& folder)
{
    const std::string out = (folder / "out").string(), model = " -m " + kAssets + "model";
    const std::map<std::string, std::string> bases = {
        {"convert", kGrid + " " + out + ".ply"},
        {"edit", kGrid + " -o " + out + ".sgrid --remove car"},
        {"fuse", folder.path().string() + " -o " + out},
        {"generate", kGrid + model + " --dry-run"},
        {"inpaint", kGrid + model + " -o " + out + ".sgrid --class car"},
        {"inspect", kGrid},
        {"page", "-o " + out + ".html --grid " + kGrid},
        {"refine", kGrid + model + " -o " + out + " --dry-run --path " + kPath},
        {"render", kGrid + " -o " + out + " --path " + kPath},
        {"streets", "-o " + out},
        {"tile", kGrid + " -o " + out},
        {"view", kGrid + model + " --screenshot " + out + ".png"},
        {"voxelize", (folder / "quad.obj").string() + " -o " + out + ".sgrid"},
    };
    const auto found = bases.find(command);
    return found == bases.end() ? "" : found->second;
}

struct Listed {
    std::string command; // "eval chamfer"
    Json option;
    std::string name() const { return option["names"][0]; }
};

void collect(const Json& command, const std::string& path, std::vector<Listed>& to)
{
    for (const Json& option : command["options"])
        if (!option["positional"])
            to.push_back({path, option});
    for (const Json& sub : command["commands"])
        collect(sub, path + " " + sub["name"].get<std::string>(), to);
}

Json help_of(const std::string& command)
{
    const ProgramResult help = semrover_program(command + " --help --json");
    EXPECT_EQ(help.code, 0) << help.err;
    const auto json = parse_json(help.out, "help");
    EXPECT_TRUE(json) << json.error().message;
    return json.value_or(Json::object());
}

std::vector<Listed> all_options()
{
    std::vector<Listed> all;
    const Json top = help_of("");
    for (const Json& option : top["options"])
        all.push_back({"", option});
    for (const Json& command : top["commands"]) // some belong to other programs, which list them themselves
        if (command["name"] != "view" || is_there(Path(SEMROVER_BINARY).replace_filename("semrover-view")))
            collect(help_of(command["name"]), command["name"], all);
    return all;
}

bool is_number(const Listed& o)
{
    return o.option["kind"] == "number" || o.option["kind"] == "integer";
}

// -1 is a number, and in the range of a few
bool in_range(const Listed& o, const std::string& text)
{
    return text == "-1" && o.option["least"].get<double>() <= -1;
}

void expect_refused(const Listed& o, const ProgramResult& r, const std::string& line)
{
    const bool code = r.code == 2 || r.code == 3 || (o.name() == "--device" && r.code == 4);
    EXPECT_TRUE(code) << line << "\nexits with " << r.code << "\n" << r.out << r.err;
    EXPECT_TRUE(r.err.starts_with("semrover: error: ") && r.err.find('\n') + 1 == r.err.size()) << line << "\n"
                                                                                                << r.err;
}

TEST(cli_options, all_say_what_they_take)
{
    const std::set<std::string> kinds = {"flag", "text", "number", "integer", "choice"};
    const std::vector<Listed> options = all_options();
    EXPECT_GT(options.size(), 250u);
    for (const Listed& o : options) {
        EXPECT_TRUE(kinds.contains(o.option["kind"])) << o.command << " " << o.option.dump();
        EXPECT_FALSE(o.option["help"].get<std::string>().empty()) << o.command << " " << o.name();
        if (is_number(o)) {
            EXPECT_LT(o.option["least"], o.option["most"]) << o.command << " " << o.name();
        }
    }
}

TEST(cli_options, numbers_and_words_out_of_range_are_usage_errors_that_name_the_option)
{
    size_t options = 0, runs = 0;
    for (const Listed& o : all_options()) {
        if (!is_number(o) && o.option["kind"] != "choice")
            continue;
        ++options;
        for (const std::string& bad : bad_values()) {
            if (is_number(o) && in_range(o, bad))
                continue;
            ++runs;
            const std::string line = o.command + " " + o.name() + " " + bad;
            const ProgramResult r = semrover_program(line);
            EXPECT_EQ(r.code, 2) << line << "\n" << r.out << r.err;
            EXPECT_TRUE(r.err.starts_with("semrover: error: ") && r.err.find('\n') + 1 == r.err.size()) << r.err;
            EXPECT_NE(r.err.find(o.name()), std::string::npos) << line << "\n" << r.err;
        }
    }
    printf("%zu options of numbers and words, %zu runs\n", options, runs);
}

TEST(cli_options, texts_that_mean_nothing_are_refused)
{
    // names of what is written, and words for readers: any text is one
    const std::set<std::string> any = {"--output",        "-o",      "--ply",   "--ply-3dgs", "--ply-2dgs",
                                       "--profile",       "--video", "--title", "--about",    "--side-by-side",
                                       "--save-features", "--csv",   "--vox",   "--cache",    "--screenshot"};
    const ScratchFolder folder;
    folder.put("quad.obj", "usemtl road\nv 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4\n");
    size_t options = 0, runs = 0;
    for (const Listed& o : all_options()) {
        if (o.option["kind"] != "text" || any.contains(o.name()))
            continue;
        ++options;
        const std::string command = o.command.empty() ? "inspect" : o.command;
        for (const std::string& bad : bad_values()) {
            // a device by its index, and boxes of a frame by any name, are asked for only where they are used
            const std::string line = o.name() == "--device"
                                         ? "bench gemm --m 8 --n 8 --k 8 --device " + bad
                                         : command + " " + base_of(command, folder) + " " + o.name() + " " + bad;
            ++runs;
            expect_refused(o, semrover_program(line), line);
        }
    }
    printf("%zu options of texts, %zu runs\n", options, runs);
}

TEST(cli_options, seeds_do_not_saturate)
{
    for (const char* seed : {"-1", "99999999999999999999", "18446744073709551616", "1.0", "0x", "nan", "+-1"}) {
        const ProgramResult r = semrover_program(std::string("streets -o /nowhere/x --seed=") + seed);
        expect_error(r, 2, "--seed: expected an integer of 64 bits");
    }
    for (const char* seed : {"0", "18446744073709551615", "0xffffffffffffffff", "+7"})
        expect_error(semrover_program(std::string("streets -o /nowhere/x --seed=") + seed), 3,
                     "cannot create a folder");
}

} // namespace cli_options_test
} // namespace semrover
