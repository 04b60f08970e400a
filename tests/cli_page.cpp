// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
// what `semrover page` writes: one file with everything in it, whatever the inputs say
#include "engine/scene/palette.h"
#include "runtime/base/dtype.h"
#include "tests/support/json_text.h"
#include "tests/support/page_inputs.h"
#include "tests/support/program.h"
#include "tools/page/page.h"

#include <algorithm>
#include <cstring>
#include <fstream>
#include <regex>
#include <tuple>

namespace semrover {
namespace cli_page_test {

namespace fs = std::filesystem;

// what lies between the tags of the script with this id
std::string script(const std::string& html, const std::string& id)
{
    const size_t at = html.find("id=\"" + id + "\"");
    if (at == std::string::npos)
        return "";
    const size_t begin = html.find('>', at) + 1;
    return html.substr(begin, html.find("</script>", begin) - begin);
}

std::vector<uint8_t> decoded(const std::string& text)
{
    const std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::vector<uint8_t> out;
    uint32_t word = 0, bits = 0;
    for (const char c : text) {
        const size_t value = digits.find(c);
        if (value == std::string_view::npos)
            break;
        word = word << 6 | uint32_t(value);
        bits += 6;
        if (bits >= 8)
            out.push_back(uint8_t(word >> (bits -= 8)));
    }
    return out;
}

struct DecodedPoint {
    std::array<double, 3> position;
    std::array<uint8_t, 3> color;
    uint8_t label;
};

// as the page's script reads them
std::vector<DecodedPoint> points_in(const std::string& html, size_t scene)
{
    const Json data = json_of(script(html, "page-data"))["scenes"][scene];
    const std::vector<uint8_t> bytes = decoded(script(html, "points-" + std::to_string(scene)));
    const size_t n = data["count"];
    EXPECT_EQ(bytes.size(), 10 * n);
    std::vector<DecodedPoint> points(bytes.size() / 10);
    for (size_t i = 0; i < points.size(); ++i) {
        for (size_t a = 0; a < 3; ++a) {
            const unsigned q = bytes[6 * i + 2 * a] | bytes[6 * i + 2 * a + 1] << 8;
            points[i].position[a] = double(data["low"][a]) + q * double(data["step"][a]);
            points[i].color[a] = bytes[6 * n + 3 * i + a];
        }
        points[i].label = bytes[9 * n + i];
    }
    return points;
}

TEST(CliPage, every_point_of_the_grid_is_in_it_to_half_a_step)
{
    const PageInputs in;
    const std::string html = in.page("--grid " + in.grid("a.sgrid").string());
    const VoxelGrid grid = street_of_cells();
    const auto points = points_in(html, 0);
    const Json data = json_of(script(html, "page-data"))["scenes"][0];
    size_t next = 0;
    for (size_t cell = 0; cell < grid.cells.size(); ++cell)
        for (size_t k = 0; grid.generated[cell] && k < size_t(grid.points_per_voxel); ++k, ++next) {
            ASSERT_LT(next, points.size());
            const size_t from = cell * size_t(grid.points_per_voxel) + k;
            for (size_t a = 0; a < 3; ++a) {
                const double at =
                    (grid.cells[cell][a] + 0.5) * double(grid.voxel_size) + half_to_float(grid.points[3 * from + a]);
                ASSERT_NEAR(points[next].position[a], at, 0.5 * double(data["step"][a]) + 1e-5);
                ASSERT_EQ(points[next].color[a], grid.colors[3 * from + a]);
            }
            ASSERT_EQ(points[next].label, grid.labels[cell]);
        }
    EXPECT_EQ(next, points.size());
    EXPECT_EQ(std::ranges::count(grid.generated, 0), 3); // those were left out
}

TEST(CliPage, of_too_many_points_every_nth_stays)
{
    const PageInputs in;
    const std::string grid = "--grid " + in.grid("a.sgrid").string();
    const auto all = points_in(in.page(grid), 0), some = points_in(in.page(grid + " --max-points 100"), 0);
    ASSERT_EQ(some.size(), 100u);
    for (size_t i = 0; i < some.size(); ++i)
        ASSERT_EQ(some[i].color, all[i * all.size() / 100].color);
}

TEST(CliPage, a_grid_of_labels_shows_the_middle_of_its_cells_and_truth_is_a_second_scene)
{
    const PageInputs in;
    VoxelGrid labels = street_of_cells();
    labels.points = {};
    labels.colors = labels.generated = {};
    ASSERT_TRUE(write_grid(in / "labels.sgrid", labels));
    const std::string html =
        in.page("--grid " + (in / "labels.sgrid").string() + " --truth " + in.grid("a.sgrid").string());
    const auto points = points_in(html, 0);
    ASSERT_EQ(points.size(), labels.cells.size());
    for (size_t i = 0; i < points.size(); ++i) {
        EXPECT_NEAR(points[i].position[0], cell_center(labels.cells[i], labels.voxel_size)[0], 1e-3);
        EXPECT_EQ(points[i].color, kPalette[labels.labels[i]].color);
    }
    EXPECT_EQ(points_in(html, 1).size(), points_in(in.page("--grid " + in.grid("a.sgrid").string()), 0).size());
    EXPECT_NE(html.find("none, only labels"), std::string::npos);
}

TEST(CliPage, pictures_of_the_moments_that_all_sets_have_are_in_it)
{
    const PageInputs in;
    in.pictures("labels", {0, 1, 2, 5});
    in.pictures("splats", {1, 2, 3, 5});
    const ProgramResult result = in.run(in.whole_arguments());
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_NE(result.err.find("1 of 4 pictures of 'splats' are left out"), std::string::npos) << result.err;
    const std::string html = contents(in / "index.html");
    const Json data = json_of(script(html, "page-data"));
    EXPECT_EQ(data["moments"], Json({1, 2, 5}));
    for (size_t set = 0; set < 2; ++set)
        for (size_t m = 0; m < 3; ++m) {
            const auto file = decoded(script(html, fmt::format("picture-{}-{}", set, m)));
            const auto image = decode_image_rgb8(std::as_bytes(std::span(file)), "picture");
            ASSERT_TRUE(image) << image.error().message;
            const ImageRgb8 expected = test_picture(set == 0 ? "labels" : "splats", data["moments"][m]);
            ASSERT_EQ(image->width, expected.width);
            double off = 0;
            for (size_t i = 0; i < image->pixels.size(); ++i)
                off += std::abs(int(image->pixels[i]) - int(expected.pixels[i]));
            EXPECT_LE(off / double(image->pixels.size()), set == 0 ? 0 : 14)
                << set << " " << m; // noise is hard on JPEG
        }
    EXPECT_NE(html.find("id=\"picture-0-0\" data-type=\"image/png\""), std::string::npos);  // flat
    EXPECT_NE(html.find("id=\"picture-1-0\" data-type=\"image/jpeg\""), std::string::npos); // noisy
}

TEST(CliPage, of_many_moments_the_first_the_last_and_even_steps_between_stay)
{
    const PageInputs in;
    in.pictures("labels", {0, 1, 2, 3, 4, 5, 6, 7, 8, 10});
    in.pictures("splats", {0, 1, 2, 3, 4, 5, 6, 7, 8, 10});
    const std::string html = in.page(in.whole_arguments() + " --max-frames 4");
    EXPECT_EQ(json_of(script(html, "page-data"))["moments"], Json({0, 3, 6, 10}));
    EXPECT_NE(html.find("4 of 10 moments"), std::string::npos);
}

// pages are looked at from file://, so nothing may be fetched
TEST(CliPage, nothing_in_it_points_outside)
{
    const PageInputs in;
    in.pictures("labels", {0, 1});
    in.pictures("splats", {0, 1});
    const std::string html = in.page(in.whole_arguments() + in.run_and_figures());
    for (const char* text : {"http:", "https:", "file:", " src=", "@import", "url(", "fetch(", "XMLHttpRequest",
                             "import(", "{{", "<link rel=\"stylesheet\"", "<iframe", "new WebSocket"})
        EXPECT_EQ(html.find(text), std::string::npos) << text;
    const std::regex references("(src|href|action|data)\\s*=\\s*\"([^\"]*)\"");
    const std::string markup = html.substr(0, html.find("page-data"));
    for (std::sregex_iterator i(markup.begin(), markup.end(), references), end; i != end; ++i)
        EXPECT_TRUE((*i)[2].str().starts_with("data:")) << i->str();
    EXPECT_NE(html.find("default-src 'none'"), std::string::npos);
}

TEST(CliPage, the_same_inputs_give_the_same_bytes)
{
    const PageInputs in;
    in.pictures("labels", {0, 1});
    in.pictures("splats", {0, 1});
    const std::string first = in.page(in.whole_arguments() + in.run_and_figures());
    EXPECT_EQ(first, in.page(in.whole_arguments() + in.run_and_figures()));
}

TEST(CliPage, tables_say_what_runs_and_figures_recorded)
{
    const PageInputs in;
    const std::string html = in.page("--grid " + in.grid("a.sgrid").string() + in.run_and_figures());
    for (const char* text : {"<bdi>generate</bdi>", "<bdi>llvmpipe</bdi>", "peak device memory", ">1.50 GiB</span>",
                             "title=\"1610612736\"", ">12 min 05 s</span>", "<bdi>0.0625</bdi>", "<bdi>chamfer</bdi>",
                             "cameras / 1 / width", "(running)", "<bdi>semrover 0.1</bdi>"})
        EXPECT_NE(html.find(text), std::string::npos) << text;
}

TEST(CliPage, labels_are_counted_in_the_palettes_colours)
{
    const PageInputs in;
    const VoxelGrid grid = street_of_cells();
    const std::string html = in.page("--grid " + in.grid("a.sgrid").string());
    for (size_t label = 0; label < kClassCount; ++label) {
        const auto cells = std::ranges::count(grid.labels, label);
        const auto& [name, c] = kPalette[label];
        const std::string row = fmt::format("<span class=\"swatch\" style=\"background:rgb({},{},{})\"></span>{}</th>",
                                            c[0], c[1], c[2], name);
        EXPECT_EQ(html.find(row) != std::string::npos, cells > 0) << name;
        if (cells) {
            const size_t at = html.find(row);
            EXPECT_NE(html.substr(at, 250).find(fmt::format("<td class=\"number\">{}</td>", cells)), std::string::npos);
        }
    }
}

constexpr const char* kHostile =
    "</script><script>alert(1)</script><img src=x onerror=alert(2)>\"'&<!--\u2028\x01\xff{{script}}";

TEST(CliPage, hostile_text_stays_text)
{
    const PageInputs in;
    VoxelGrid grid = street_of_cells();
    grid.metadata = {{"name", "<b>bold</b></style><script>alert(3)</script>"}, {"<i>key", "{{payload}}"}};
    ASSERT_TRUE(write_grid(in / "hostile.sgrid", grid));
    in.pictures("labels", {0});
    std::ofstream(in / "run.json") << Json{{"settings", {{"command", "<u>x"}, {"</table>", "</td><script>"}}}};
    std::ofstream(in / "figures.json") << Json{{"a</th><script>", "b\u2028</bdi>"}};
    const std::string hostile =
        fmt::format("'{}'", std::regex_replace(std::string(kHostile), std::regex("'"), "'\\''"));
    const ProgramResult result = in.run(
        fmt::format("--grid {0}/hostile.sgrid --truth {0}/hostile.sgrid --title {1} --about {1} --frames "
                    "'</script><script>alert(1)</script>={0}/labels' --run {0}/run.json --figures {0}/figures.json",
                    in.folder().string(), hostile));
    ASSERT_EQ(result.code, 0) << result.err;
    const std::string html = contents(in / "index.html");
    for (const char* text : {"<script>alert", "<img", "<b>", "<u>", "<i>", "</table>\"", "</td><script>", "\x01",
                             "\xff", "</style><script>"})
        EXPECT_EQ(html.find(text), std::string::npos) << text;
    EXPECT_EQ(html.find("\u2028", html.find("id=\"page-data\"")), std::string::npos); // in markup only
    const Json data = json_of(script(html, "page-data"));
    EXPECT_EQ(data["sets"][0]["name"].get<std::string>().find("</script><script>alert(1)</script>"), 0u);
    EXPECT_NE(html.find("&lt;/script&gt;&lt;script&gt;alert(1)"), std::string::npos);
    const auto tags = [&](const std::string& tag) {
        size_t count = 0;
        for (size_t at = html.find(tag); at != std::string::npos; at = html.find(tag, at + 1))
            ++count;
        return count;
    };
    EXPECT_EQ(tags("<script"), 5u); // data, two scenes, a picture, the script
    EXPECT_EQ(tags("</script>"), 5u);
    EXPECT_EQ(tags("</style>"), 1u);
}

TEST(CliPage, an_existing_page_is_kept_without_yes)
{
    const PageInputs in;
    const std::string grid = " --grid " + in.grid("a.sgrid").string();
    std::ofstream(in / "index.html") << "mine";
    expect_error(semrover_program("page -q -o " + (in / "index.html").string() + grid), 2, "exists; -y replaces it");
    EXPECT_EQ(contents(in / "index.html"), "mine");
    const size_t entries = in.entries();
    EXPECT_NE(in.page(grid), "mine"); // with -y
    EXPECT_EQ(in.entries(), entries);
}

TEST(CliPage, what_cannot_be_shown_is_named_and_nothing_is_left)
{
    const PageInputs in;
    const std::string grid = "--grid " + in.grid("a.sgrid").string() + " ", at = in.folder().string() + "/";
    in.pictures("labels", {0, 1});
    in.pictures("late", {7, 9});
    in.pictures("wide", {0, 1}, 96, 32);
    in.pictures("grown", {0});
    in.pictures("grown", {1}, 72, 48);
    in.pictures("double", {3});
    in.put("double/3.png", "");
    in.pictures("cut", {0});
    in.put("cut/000000.png", contents(in / "labels/000000.png").substr(0, 60));
    in.pictures("text", {0});
    in.put("text/000000.png", "hello");
    fs::create_directories(in / "drive/color");
    in.put("list.json", "[1]");
    in.put("nested.json", R"({"a": {"b": 1}})");
    in.put("empty.json", "{}");
    in.put("broken.json", R"({"settings": )");
    in.put("norun.json", R"({"state": "finished"})");
    in.put("short.sgrid", contents(in / "a.sgrid").substr(0, 300));
    in.put("bad.tum", "1 2 3\n");
    const std::vector<std::tuple<std::string, int, std::string>> cases = {
        {"--grid " + at + "none.sgrid", 3, "none.sgrid'"},
        {"--grid " + at + "short.sgrid", 3, "short.sgrid'"},
        {grid + "--truth " + at + "list.json", 3, "list.json'"},
        {grid + "--frames labels", 2, "--frames: expected NAME=FOLDER, found 'labels'"},
        {grid + "--frames =x", 2, "expected NAME=FOLDER"},
        {grid + "--frames a=" + at + "labels --frames a=" + at + "labels", 2, "two sets have the name 'a'"},
        {grid + "--frames a=" + at + "none", 3, "expected a folder of pictures: cannot list"},
        {grid + "--frames a=" + at + "drive", 3, "expected pictures named 000000.png, found none; there is '"},
        {grid + "--frames a=" + at + "labels --frames b=" + at + "late", 3,
         "no moment is in all sets of pictures: 'a' has 0 to 1, 'b' has 7 to 9"},
        {grid + "--frames a=" + at + "labels --frames b=" + at + "wide", 3, "96 x 32 pixels beside 48 x 32 of 'a'"},
        {grid + "--frames a=" + at + "grown", 3, "72 x 48 pixels, but the first picture of 'a' has 48 x 32"},
        {grid + "--frames a=" + at + "double", 3, "two pictures have the number 3: '000003.png' and '3.png'"},
        {grid + "--frames a=" + at + "cut", 3, "000000.png': not a valid PNG"},
        {grid + "--frames a=" + at + "text", 3, "expected a PNG or JPEG image"},
        {grid + "--figures " + at + "list.json", 3, "expected an object of names and values, found array"},
        {grid + "--figures " + at + "nested.json", 3, "'a': expected a number or text, found an object"},
        {grid + "--figures " + at + "empty.json", 3, "there are no figures in it"},
        {grid + "--run " + at + "broken.json", 3, "broken.json'"},
        {grid + "--run " + at + "norun.json", 3, "expected a run with \"settings\", found an object without them"},
        {grid + "--run " + at + "list.json", 3, "expected a run with \"settings\", found array"},
        {grid + "--run " + at + "labels", 3, "run.json'"},
        {grid + "--path " + at + "bad.tum", 3, "bad.tum"},
        {grid + "--max-frames 0", 2, "--max-frames"},
        {grid + "--max-points 0", 2, "--max-points"},
        {"--title x", 2, "--grid"},
    };
    const size_t entries = in.entries();
    for (const auto& [arguments, code, text] : cases) {
        SCOPED_TRACE(arguments);
        expect_error(in.run(arguments), code, text);
        EXPECT_FALSE(fs::exists(in / "index.html"));
        EXPECT_EQ(in.entries(), entries);
    }
    expect_error(semrover_program("page -q " + grid + "-o " + at + "nowhere/index.html"), 3, "nowhere");
}

TEST(CliPage, text_for_a_page_is_escaped_and_base64_is_the_rfcs)
{
    EXPECT_EQ(html_text("a<b>&\"'\n\xc3\xa9\xff"), "a&lt;b&gt;&amp;&quot;&#39;\\x0a\xc3\xa9\\xff");
    EXPECT_EQ(html_text("abcdef", 3), "abc...");
    EXPECT_EQ(script_json(Json{{"a", "</script>\u2028&\xff"}}),
              "{\"a\":\"\\u003c/script\\u003e\\u2028\\u0026\\ufffd\"}");
    // RFC 4648, section 10
    for (const auto& [plain, text] : {std::pair{"", ""},
                                      {"f", "Zg=="},
                                      {"fo", "Zm8="},
                                      {"foo", "Zm9v"},
                                      {"foob", "Zm9vYg=="},
                                      {"foobar", "Zm9vYmFy"}})
        EXPECT_EQ(base64(std::as_bytes(std::span(plain, strlen(plain)))), text);
    EXPECT_EQ(counted(0), "0");
    EXPECT_EQ(counted(1234567), "1,234,567");
    EXPECT_EQ(counted(123456), "123,456");
}

} // namespace cli_page_test
} // namespace semrover
