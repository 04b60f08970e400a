// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
// what `semrover page` writes, in a browser: the page tries itself (assets/page/check.js) and reports
#include "tests/support/json_text.h"
#include "tests/support/page_inputs.h"
#include "tests/support/program.h"

#include <cstdlib>
#include <cstring>

namespace semrover {
namespace cli_page_browser_test {

constexpr int kMoments = 4;

std::string unescaped(std::string text)
{
    for (const auto& [from, to] : {std::pair{"&quot;", "\""}, {"&lt;", "<"}, {"&gt;", ">"}, {"&amp;", "&"}})
        for (size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += strlen(to))
            text.replace(at, strlen(from), to);
    return text;
}

// a document after its scripts, and the report in it; null where the page did not come so far
struct Seen {
    std::string document;
    Json report;
};

class CliPageBrowser : public testing::Test {
  protected:
    void SetUp() override
    {
        ASSERT_EQ(std::system("command -v chromium >/dev/null"), 0)
            << "chromium is missing, without which nobody knows whether pages work: tools/setup --test installs it";
        in_.pictures("labels", {0, 1, 2, 3});
        in_.pictures("splats", {0, 1, 2, 3});
    }

    Seen open(const std::string& html, const std::string& words, const std::string& options) const
    {
        in_.put("page.html", html);
        const std::string line = fmt::format(
            "HOME={0} timeout 100 chromium --headless --no-sandbox --disable-dev-shm-usage --no-first-run "
            "--user-data-dir={0}/profile --virtual-time-budget=30000 {1} --dump-dom 'file://{0}/page.html#{2}' "
            ">{0}/document 2>{0}/log </dev/null",
            in_.folder().string(), options, words);
        EXPECT_EQ(std::system(line.c_str()), 0) << contents(in_ / "log");
        Seen seen{contents(in_ / "document"), {}};
        const std::string name = "data-report=\"";
        if (const size_t at = seen.document.find(name); at != std::string::npos) {
            const size_t begin = at + name.size();
            seen.report = Json::parse(unescaped(seen.document.substr(begin, seen.document.find('"', begin) - begin)),
                                      nullptr, false);
        }
        return seen;
    }

    std::string whole_page() const
    {
        return in_.page(in_.whole_arguments() + in_.run_and_figures() + " --truth " + in_.grid("a.sgrid").string());
    }

    // all that the page can do, done
    void expect_working(const Json& report, const std::string& renderer) const
    {
        ASSERT_TRUE(report.is_object()) << "no report";
        SCOPED_TRACE(report.dump(1));
        EXPECT_EQ(report["errors"], Json::array());
        ASSERT_EQ(report.value("finished", false), true);
        EXPECT_EQ(report["renderer"], renderer);
        const VoxelGrid grid = street_of_cells();
        EXPECT_EQ(report["points"], (grid.cells.size() - 3) * 4);
        EXPECT_EQ(report["frames"], 2 * kMoments);
        const Json& player = report["player"];
        EXPECT_EQ(player["pictures"], 2 * kMoments);
        EXPECT_EQ(player["visible"], 48 * 32);
        EXPECT_GT(player["sets_differ"], 1200);
        EXPECT_GT(player["moments_differ"], 1200);
        EXPECT_EQ(player["moment_after_key"], 1);
        EXPECT_NEAR(player["border_after_drag"], 0.25, 0.01);
        EXPECT_EQ(player["border_after_end"], 1);
        EXPECT_EQ(player["playing"], "true");
        EXPECT_NE(player["moment_after_play"], player["moment_after_key"]);
        const Json& orbit = report["orbit"];
        EXPECT_GT(orbit["visible"], double(orbit["samples"]) / 20); // the street fills a good part of the view
        EXPECT_LT(orbit["visible"], double(orbit["samples"]) * 0.95);
        EXPECT_EQ(orbit["still"], 0); // the same view twice is the same picture
        for (const char* act : {"orbit", "pan", "pinch", "wheel", "key", "labels", "drive"})
            EXPECT_GT(orbit[act], double(orbit["visible"]) / 10) << act;
        EXPECT_EQ(orbit["hidden"], orbit["visible"]); // without classes nothing is left
        const std::array<float, 3> center = cell_center(grid.cells.back(), grid.voxel_size);
        for (size_t a = 0; a < 3; ++a) {
            const size_t from = grid.points.size() - 3 + a;
            EXPECT_NEAR(orbit["last_point"][a], center[a] + half_to_float(grid.points[from]), 1e-3);
            EXPECT_EQ(orbit["last_point"][3 + a], grid.colors[from]);
        }
        EXPECT_EQ(orbit["last_point"][6], grid.labels.back());
        EXPECT_GT(orbit["closer"], 1.2); // a double click
        EXPECT_EQ(orbit["scenes"], 2);
        EXPECT_EQ(orbit["parts"].size(), 144u);
        EXPECT_LE(report["layout"]["content"], report["layout"]["width"]); // no scrolling sideways
    }

    const PageInputs in_;
};

constexpr const char* kPhone = "--window-size=390,800 --disable-gpu --disable-3d-apis";
// WebGL without a GPU, on a screen of fine pixels
constexpr const char* kWide = "--window-size=720,500 --force-device-scale-factor=1.5 --use-gl=angle "
                              "--use-angle=swiftshader --enable-unsafe-swiftshader";

TEST_F(CliPageBrowser, pictures_play_and_points_turn_with_webgl_as_on_a_canvas)
{
    const std::string page = whole_page();
    const Json drawn = open(page, "check", kWide).report, canvas = open(page, "check,canvas", kWide).report;
    expect_working(drawn, "webgl2");
    expect_working(canvas, "canvas");
    ASSERT_FALSE(HasFailure());
    EXPECT_EQ(drawn["orbit"]["view"], canvas["orbit"]["view"]);
    const auto share = [](const Json& report) {
        return double(report["orbit"]["visible"]) / double(report["orbit"]["samples"]);
    };
    EXPECT_NEAR(share(drawn), share(canvas), 0.02);
    double off = 0;
    for (size_t i = 0; i < 144; ++i)
        off += std::abs(double(drawn["orbit"]["parts"][i]) - double(canvas["orbit"]["parts"][i])) / 144;
    EXPECT_LT(off, 4) << drawn["orbit"]["parts"] << canvas["orbit"]["parts"];
}

TEST_F(CliPageBrowser, a_phone_without_webgl_shows_all_of_it)
{
    expect_working(open(whole_page(), "check", kPhone).report, "canvas");
}

TEST_F(CliPageBrowser, a_page_without_pictures_has_the_scene_only)
{
    const std::string page = in_.page("--grid " + in_.grid("a.sgrid").string());
    const Json report = open(page, "check", kPhone).report;
    ASSERT_TRUE(report.is_object());
    EXPECT_EQ(report["errors"], Json::array());
    EXPECT_EQ(report["player"], nullptr);
    EXPECT_EQ(report["orbit"]["drive"], 0); // there is no path either
    EXPECT_GT(report["orbit"]["visible"], 1000);
}

TEST_F(CliPageBrowser, hostile_text_runs_nothing)
{
    const std::string script = "</script><script>document.documentElement.setAttribute(`data-taken`, 1)</script>";
    const std::string picture = "<img src=x onerror=document.documentElement.dataset.taken=2>";
    const std::string page =
        in_.page(fmt::format("--grid {0} --title '{1}{2}' --about '{1}{2}' --frames '{1}={3}'",
                             in_.grid("a.sgrid").string(), script, picture, (in_ / "labels").string()));
    const Seen seen = open(page, "check", kPhone);
    ASSERT_TRUE(seen.report.is_object());
    EXPECT_EQ(seen.report["errors"], Json::array());
    EXPECT_EQ(seen.document.find("data-taken=\""), std::string::npos);
    EXPECT_EQ(seen.document.find("<img"), std::string::npos);
}

// what keeps the tests above honest
TEST_F(CliPageBrowser, a_broken_page_says_so)
{
    const std::string page = whole_page();
    const auto broken = [&](const std::string& at, const std::string& what) {
        std::string text = page;
        const size_t begin = text.find(at);
        EXPECT_NE(begin, std::string::npos) << at;
        return text.replace(begin + at.size(), 8, what);
    };
    const auto report_of = [&](const std::string& html) { return open(html, "check", kPhone).report; };
    const Json picture = report_of(broken("id=\"picture-1-2\" data-type=\"image/jpeg\">", "AAAAAAAA"));
    ASSERT_TRUE(picture.is_object());
    EXPECT_EQ(picture["errors"][0], "picture-1-2 is not a picture");
    EXPECT_FALSE(picture.contains("finished"));
    const Json points = report_of(broken("id=\"points-0\">", ""));
    ASSERT_TRUE(points.is_object());
    EXPECT_NE(points["errors"][0].get<std::string>().find("bytes, expected"), std::string::npos);
    EXPECT_EQ(points["points"], 0);
    EXPECT_EQ(points["frames"], 2 * kMoments); // the drive still works
    EXPECT_EQ(report_of(broken("class Orbit {", "}}}}}}}}")), Json());
}

} // namespace cli_page_browser_test
} // namespace semrover
