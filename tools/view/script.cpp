// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/view/script.h"

#include "runtime/base/quote.h"
#include "tools/cli/value_options.h"
#include "tools/view/viewer.h"

#include <sstream>

namespace semrover::view {

namespace {

constexpr double kDegree = 0.017453292519943295;

// what a step gets: its numbers, its file, and how many frames it has taken before
struct Given {
    const std::vector<double>& numbers;
    const std::string& file;
    uint32_t frames = 0;
};
using Done = Result<bool>; // false: it goes on in the next frame
using Do = Done (*)(Viewer&, const Given&);

Done done(const Status& status)
{
    return status ? Done(true) : tl::make_unexpected(status.error());
}

Done look(Viewer& v, const Given& g)
{
    v.camera.position = {g.numbers[0], g.numbers[1], g.numbers[2]};
    v.camera.yaw = g.numbers[3] * kDegree;
    v.camera.pitch = 0;
    v.camera.turn(0, g.numbers[4] * kDegree);
    return true;
}

Done orbit(Viewer& v, const Given& g)
{
    v.camera.orbit(g.numbers[0] * kDegree, g.numbers[1] * kDegree);
    return true;
}

Done fly(Viewer& v, const Given& g)
{
    const double frames = g.numbers[3];
    v.camera.move(g.numbers[0] / frames, g.numbers[1] / frames, g.numbers[2] / frames);
    return g.frames + 1 >= frames;
}

Done click(Viewer& v, const Given& g)
{
    SR_CHECK(v.click(g.numbers[0], g.numbers[1]));
    if (!v.picked())
        return fail(ErrorCode::bad_input, "no voxel at pixel ({}, {})", g.numbers[0], g.numbers[1]);
    return true;
}

Done paint(Viewer& v, const Given&)
{
    const size_t before = v.brush.strokes();
    SR_CHECK(v.paint());
    if (v.brush.strokes() == before)
        return fail(ErrorCode::bad_input, "no voxel was changed");
    return true;
}

Done set_label(Viewer& v, const Given& g)
{
    v.brush.label = g.numbers[0] < 0 ? SR_NO_CELL : uint32_t(g.numbers[0]);
    return true;
}

// kinds: n a number, f a file, l a class or none, s what is shown, o on or off
struct Verb {
    std::string_view name, kinds;
    Do act;
};

const Verb kVerbs[] = {
    {"look", "nnnnn", look},
    {"orbit", "nn", orbit},
    {"fly", "nnnn", fly},
    {"frames", "n", [](Viewer&, const Given& g) -> Done { return g.frames + 1 >= g.numbers[0]; }},
    {"wait", "", [](Viewer& v, const Given& g) -> Done { return g.frames > 0 && v.settled(); }},
    {"show", "s", [](Viewer& v, const Given& g) { return done(v.show(Shown(g.numbers[0]))); }},
    {"click", "nn", click},
    {"reach", "n", [](Viewer& v, const Given& g) -> Done { return v.brush.reach = int(g.numbers[0]), true; }},
    {"label", "l", set_label},
    {"paint", "", paint},
    {"undo", "", [](Viewer& v, const Given&) { return done(v.undo()); }},
    {"record", "o", [](Viewer& v, const Given& g) -> Done { return v.recorder.on = g.numbers[0] != 0, true; }},
    {"play", "", [](Viewer& v, const Given&) -> Done { return v.play(), true; }},
    {"path", "f", [](Viewer& v, const Given& g) { return done(v.save_path(g.file)); }},
    {"grid", "f", [](Viewer& v, const Given& g) { return done(v.save_grid(g.file)); }},
    {"refine", "", [](Viewer& v, const Given&) { return done(v.refine()); }},
    {"shot", "f", [](Viewer& v, const Given& g) { return done(v.save_picture(g.file)); }},
    {"quit", "", [](Viewer& v, const Given&) -> Done { return v.quit(), true; }},
};

Result<double> word_of(std::span<const char* const> words, const std::string& text)
{
    for (size_t n = 0; n < words.size(); ++n)
        if (text == words[n])
            return double(n);
    return fail(ErrorCode::bad_input, "expected one of {}, found {}", fmt::join(words, ", "), quote(text, 60));
}

Result<double> value_of(char kind, const std::string& text)
{
    constexpr std::array<const char*, 2> switches = {"off", "on"};
    if (kind == 's')
        return word_of(kShownNames, text);
    if (kind == 'o')
        return word_of(switches, text);
    if (kind == 'n')
        return parse_number<double>(text, {-1e6, 1e6});
    if (text == "none")
        return -1;
    return class_option("label", text).map([](uint8_t label) { return double(label); });
}

} // namespace

Result<Script> Script::read(const Path& path)
{
    Script script;
    SR_TRY(const std::string text, read_text_file(path, 1 << 20));
    std::istringstream lines(text);
    size_t number = 0;
    for (std::string line; std::getline(lines, line);)
        SR_CHECK(script.add(line.substr(0, line.find('#')), fmt::format("{}:{}", quote_path(path), ++number)));
    return script;
}

Status Script::add(std::string_view line, std::string_view where)
{
    std::istringstream words{std::string(line)};
    std::string word;
    if (!(words >> word))
        return {};
    Step step{.where = std::string(where), .numbers = {}, .file = {}};
    while (step.verb < std::size(kVerbs) && kVerbs[step.verb].name != word)
        ++step.verb;
    if (step.verb == std::size(kVerbs))
        return fail(ErrorCode::bad_input, "{}: there is no step {}", where, quote(word, 60));
    const Verb& verb = kVerbs[step.verb];
    for (const char kind : verb.kinds) {
        if (!(words >> word))
            return fail(ErrorCode::bad_input, "{}: {} takes {} words", where, verb.name, verb.kinds.size());
        if (kind == 'f') {
            step.file = word;
            continue;
        }
        const Result<double> value = value_of(kind, word);
        if (!value)
            return fail(ErrorCode::bad_input, "{}: {}: {}", where, verb.name, value.error().message);
        step.numbers.push_back(*value);
    }
    if (words >> word)
        return fail(ErrorCode::bad_input, "{}: {} takes {} words", where, verb.name, verb.kinds.size());
    steps_.push_back(std::move(step));
    return {};
}

Status Script::add_shot(const Path& file, std::string_view where)
{
    SR_CHECK(add("shot file", where));
    steps_.back().file = file.string();
    return {};
}

Status Script::advance(Viewer& viewer)
{
    if (steps_.empty())
        return {};
    Step& step = steps_.front();
    const Result<bool> done = kVerbs[step.verb].act(viewer, {step.numbers, step.file, step.frames++});
    if (!done)
        return fail(done.error().code, "{}: {}", step.where, done.error().message);
    if (*done)
        steps_.pop_front();
    return {};
}

} // namespace semrover::view
