// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/run/job_file.h"

#include "engine/camera/camera.h"
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"
#include "tools/cli/value_options.h"
#include "tools/run/command_options.h"
#include "tools/run/wildcard.h"

#include <algorithm>
#include <set>

namespace semrover {

namespace {

namespace fs = std::filesystem;
using Kind = JobValue::Kind;

constexpr size_t kMostScenes = 1'000'000;

// how many letters have to be changed, added or left out
size_t edit_distance(std::string_view a, std::string_view b)
{
    std::vector<size_t> row(b.size() + 1);
    for (size_t j = 0; j <= b.size(); ++j)
        row[j] = j;
    for (size_t i = 1; i <= a.size(); ++i) {
        size_t diagonal = std::exchange(row[0], i);
        for (size_t j = 1; j <= b.size(); ++j) {
            const size_t changed = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = std::exchange(row[j], std::min({changed, row[j] + 1, row[j - 1] + 1}));
        }
    }
    return row[b.size()];
}

bool is_folder_name(std::string_view name)
{
    return !name.empty() && name.size() <= 120 && name[0] != '.' && std::ranges::all_of(name, [](unsigned char c) {
        return std::isalnum(c) || c == '-' || c == '_' || c == '.';
    });
}

// Reads one file; errors stand where they are made, with their place.
class JobReader {
  public:
    explicit JobReader(JobFile& job) : job_(job), folder_(fs::absolute(job.path).parent_path()) {}

    Status read(const JobValue& root, const Path& out);

  private:
    using Keys = std::vector<std::string>;

    tl::unexpected<Error> refuse(const JobValue& at, const std::string& reason) const
    {
        return fail(ErrorCode::bad_input, "{}:{}:{}: {}", quote_path(job_.path), at.line, at.column, reason);
    }
    tl::unexpected<Error> wrong(const JobValue& at, std::string_view key, std::string_view expected) const
    {
        return refuse(at, fmt::format("{}: expected {}, found {}", quote(key), expected,
                                      at.is_single() ? quote(at.text) : std::string(kind_name(at.kind))));
    }
    tl::unexpected<Error> unknown(const JobValue& at, std::string_view key, const Keys& known) const;
    Status check_keys(const JobValue& table, const Keys& known) const;
    Status check_table(const JobValue* table, std::string_view key) const;
    Result<std::string> text(const JobValue& table, std::string_view key) const; // empty where it is not there
    Result<bool> flag(const JobValue& table, std::string_view key, bool otherwise) const;
    Result<std::vector<const JobValue*>> tables(const JobValue& root, std::string_view key) const;
    Path resolve(const std::string& path) const { return (folder_ / path).lexically_normal(); }
    Result<std::vector<JobOption>> options(const CommandOptions& command, const JobValue& table,
                                           const Keys& others) const;

    Status read_top(const JobValue& root, const Path& out);
    Status read_output(const JobValue* output);
    Status read_color(const JobValue& at);
    Status read_scene(const JobValue& table);
    Status add_files(const JobValue& table, std::string_view key, JobScene::Source source);
    Status add_streets(const JobValue& table, const JobValue& streets);
    Status add_scene(const JobValue& at, JobScene scene);
    Result<std::pair<uint64_t, uint64_t>> seeds(const JobValue& streets) const;
    Status read_drive(const JobValue& table, const CommandOptions& command, const std::vector<JobOption>& shared);
    Status check_paths(const JobValue& at, const JobDrive& drive) const;
    Status check_together(const JobValue& root) const;
    Status check_line(const JobValue& at, std::vector<std::string> line, const std::vector<JobOption>& options) const;

    JobFile& job_;
    Path folder_;
    std::set<std::string> names_;
    std::vector<JobOption> output_; // options of the drives' command that [output] stands for
};

tl::unexpected<Error> JobReader::unknown(const JobValue& at, std::string_view key, const Keys& known) const
{
    const auto nearest =
        std::ranges::min_element(known, {}, [&](const std::string& k) { return edit_distance(key, k); });
    if (nearest != known.end() && edit_distance(key, *nearest) <= (key.size() < 5 ? 1 : 2))
        return refuse(at, fmt::format("unknown key {}; is it {}?", quote(key), quote(*nearest)));
    if (known.size() > 16)
        return refuse(at, fmt::format("unknown key {}", quote(key)));
    return refuse(at, fmt::format("unknown key {}; there are {}", quote(key), fmt::join(known, ", ")));
}

Status JobReader::check_keys(const JobValue& table, const Keys& known) const
{
    for (const auto& [key, value] : table.members)
        if (!std::ranges::count(known, key))
            return unknown(value, key, known);
    return {};
}

Status JobReader::check_table(const JobValue* table, std::string_view key) const
{
    return !table || table->kind == Kind::table ? Status() : wrong(*table, key, "a table");
}

Result<std::string> JobReader::text(const JobValue& table, std::string_view key) const
{
    const JobValue* value = table.find(key);
    if (!value)
        return std::string();
    if (value->kind != Kind::text || value->text.empty() || value->text.find('\0') != std::string::npos)
        return wrong(*value, key, "a text");
    return value->text;
}

Result<bool> JobReader::flag(const JobValue& table, std::string_view key, bool otherwise) const
{
    const JobValue* value = table.find(key);
    if (!value)
        return otherwise;
    if (value->kind != Kind::boolean)
        return wrong(*value, key, "true or false");
    return value->text == "true";
}

// [[key]], or the one table [key]
Result<std::vector<const JobValue*>> JobReader::tables(const JobValue& root, std::string_view key) const
{
    std::vector<const JobValue*> tables;
    const JobValue* value = root.find(key);
    if (!value)
        return tables;
    if (value->kind == Kind::table)
        return std::vector{value};
    if (value->kind != Kind::list)
        return wrong(*value, key, "tables");
    for (const JobValue& item : value->items) {
        SR_CHECK(check_table(&item, key));
        tables.push_back(&item);
    }
    return tables;
}

// A text that names a file beside the job is that file
Result<std::vector<JobOption>> JobReader::options(const CommandOptions& command, const JobValue& table,
                                                  const Keys& others) const
{
    std::vector<JobOption> options;
    for (const auto& [key, value] : table.members) {
        if (std::ranges::count(others, key))
            continue;
        const Json* facts = command.find(key);
        if (!facts) {
            Keys known = command.keys();
            known.insert(known.end(), others.begin(), others.end());
            return unknown(value, key, known);
        }
        auto option = command.option(*facts, key, value);
        if (!option)
            return refuse(value, option.error().message);
        if (!*option)
            continue;
        if (value.kind == Kind::text && is_file(resolve(value.text)))
            (*option)->second = resolve(value.text).string();
        options.push_back(std::move(**option));
    }
    return options;
}

Status JobReader::read_top(const JobValue& root, const Path& out)
{
    SR_CHECK(
        check_keys(root, {"name", "out", "model", "seed", "scene", "drive", "generate", "render", "refine", "output"}));
    SR_TRY(job_.name, text(root, "name"));
    if (job_.name.empty())
        job_.name = job_.path.stem().string();
    SR_TRY(const std::string own, text(root, "out"));
    if (own.empty() && out.empty())
        return fail(ErrorCode::usage, "{} has no 'out', and -o/--output is not given", quote_path(job_.path));
    job_.out = out.empty() ? resolve(own) : fs::absolute(out).lexically_normal();
    SR_TRY(const std::string model, text(root, "model"));
    if (!model.empty()) {
        job_.model = resolve(model);
        if (!is_there(job_.model))
            return refuse(*root.find("model"), fmt::format("'model': {} is not there", quote_path(job_.model)));
    }
    if (const JobValue* seed = root.find("seed")) {
        const auto number = parse_number<uint64_t>(seed->text, {0, ~0ull});
        if (seed->kind != Kind::integer || !number)
            return wrong(*seed, "seed", "an integer from 0");
        job_.seed = *number;
    }
    for (const char* key : {"generate", "render", "refine", "output"})
        SR_CHECK(check_table(root.find(key), key));
    if (const JobValue* render = root.find("render"); render && root.find("refine"))
        return refuse(*render, "'render' and 'refine': one of them makes the frames of a drive");
    return {};
}

Status JobReader::read_color(const JobValue& at)
{
    const std::string& color = at.text;
    const bool jpeg = at.kind == Kind::text && color.starts_with("jpeg");
    const auto quality = color.size() > 5 ? parse_number<int>(color.substr(5), {1, 100}) : Result<int>(0);
    if (at.kind != Kind::text || (color != "png" && !jpeg) || (jpeg && color.size() > 4 && color[4] != ':') || !quality)
        return wrong(at, "color", "png, jpeg or jpeg:QUALITY");
    output_.emplace_back("--format", jpeg ? "jpeg" : "png");
    if (jpeg && *quality)
        output_.emplace_back("--quality", std::to_string(*quality));
    return {};
}

Status JobReader::read_output(const JobValue* output)
{
    if (!output)
        return {};
    SR_CHECK(check_keys(*output, {"layout", "shard_bytes", "buffers", "refine", "color", "depth"}));
    SR_TRY(const std::string layout, text(*output, "layout"));
    if (!layout.empty() && layout != "folder" && layout != "shards")
        return wrong(*output->find("layout"), "layout", "folder or shards");
    job_.layout = layout == "shards" ? JobLayout::shards : JobLayout::folder;
    if (const JobValue* bytes = output->find("shard_bytes")) {
        job_.shard_bytes = bytes->text;
        if (!bytes->is_single() || !parse_memory_size(bytes->text))
            return wrong(*bytes, "shard_bytes", "a size such as 512M");
        if (job_.layout != JobLayout::shards)
            return refuse(*bytes, "'shard_bytes' has a meaning with layout = \"shards\"");
    }
    if (const JobValue* buffers = output->find("buffers")) {
        if (buffers->kind != Kind::list || buffers->items.empty())
            return wrong(*buffers, "buffers", "a list of kinds of pictures");
        for (const JobValue& item : buffers->items) {
            if (item.kind != Kind::text || !std::ranges::count(kBufferKinds, item.text))
                return wrong(item, "buffers", fmt::format("{}", fmt::join(kBufferKinds, ", ")));
            job_.buffers.push_back(item.text);
        }
    }
    SR_TRY(job_.refined, flag(*output, "refine", job_.refined));
    if (const JobValue* color = output->find("color"))
        SR_CHECK(read_color(*color));
    if (const JobValue* depth = output->find("depth")) {
        SR_TRY(const std::string kind, text(*output, "depth"));
        if (kind != "mm" && kind != "cm" && kind != "kitti256" && kind != "npy")
            return wrong(*depth, "depth", "mm, cm, kitti256 or npy");
        output_.emplace_back("--depth", kind);
    }
    return {};
}

Status JobReader::add_scene(const JobValue& at, JobScene scene)
{
    if (!is_folder_name(scene.name))
        return refuse(at, fmt::format("{}: a scene's name is of letters, digits, '-', '_' and '.'", quote(scene.name)));
    if (!names_.insert(scene.name).second)
        return refuse(at, fmt::format("two scenes have the name {}", quote(scene.name)));
    if (job_.scenes.size() >= kMostScenes)
        return refuse(at, fmt::format("a job has at most {} scenes", kMostScenes));
    job_.scenes.push_back(std::move(scene));
    return {};
}

Status JobReader::add_files(const JobValue& table, std::string_view key, JobScene::Source source)
{
    const JobValue& at = *table.find(key);
    SR_TRY(const std::string pattern, text(table, key));
    SR_TRY(const std::string name, text(table, "name"));
    SR_TRY(std::string objects, text(table, "objects"));
    if (!objects.empty() && objects != "auto" && objects != "none") {
        objects = resolve(objects).string();
        if (!is_file(objects))
            return refuse(*table.find("objects"), fmt::format("'objects': {} is not there", quote(objects)));
    }
    SR_TRY(const std::vector<Path> files, paths_like(resolve(pattern)));
    if (files.empty())
        return refuse(at, fmt::format("{}: no file is {}", quote(key), quote_path(resolve(pattern))));
    if (!name.empty() && files.size() > 1)
        return refuse(*table.find("name"), fmt::format("'name': {} files have one name", files.size()));
    for (const Path& file : files) {
        std::string own = file.filename().string();
        own = name.empty() ? own.substr(0, own.find('.')) : name;
        std::error_code error;
        const uint64_t bytes = is_folder(file) ? 0 : fs::file_size(file, error);
        SR_CHECK(add_scene(
            at, {.source = source, .name = own, .file = file, .objects = objects, .weight = error ? 0 : bytes}));
    }
    return {};
}

// "1..1000", "7", or 7
Result<std::pair<uint64_t, uint64_t>> JobReader::seeds(const JobValue& streets) const
{
    const JobValue* value = streets.find("seeds");
    if (!value)
        return refuse(streets, "'streets': 'seeds' are missing, such as seeds = \"1..20\"");
    const std::string& t = value->text;
    const size_t dots = t.find("..");
    const auto first = parse_number<uint64_t>(t.substr(0, dots), {0, 1ull << 62});
    const auto last = dots == std::string::npos ? first : parse_number<uint64_t>(t.substr(dots + 2), {0, 1ull << 62});
    if ((value->kind != Kind::text && value->kind != Kind::integer) || !first || !last || *first > *last)
        return wrong(*value, "seeds", "FIRST..LAST");
    if (*last - *first >= kMostScenes)
        return refuse(*value, fmt::format("a job has at most {} scenes", kMostScenes));
    return std::pair(*first, *last);
}

Status JobReader::add_streets(const JobValue& table, const JobValue& streets)
{
    SR_CHECK(check_table(&streets, "streets"));
    SR_TRY(const auto range, seeds(streets));
    SR_TRY(const auto command,
           CommandOptions::create("streets", {"output", "seed", "no-grids", "images", "samples", "ambient-rays",
                                              "sun-azimuth", "sun-elevation", "clouds", "width", "height", "fov-x"}));
    SR_TRY(const std::vector<JobOption> given, options(command, streets, {"seeds"}));
    SR_TRY(const std::string objects, text(table, "objects"));
    if (!objects.empty() && objects != "auto" && objects != "none")
        return wrong(*table.find("objects"), "objects", "auto or none: a street has its own");
    SR_TRY(const std::string prefix, text(table, "name"));
    double metres = 200;
    for (const auto& [option, value] : given)
        metres = option == "--length" ? std::strtod(value.c_str(), nullptr) : metres;
    for (uint64_t seed = range.first; seed <= range.second; ++seed) {
        JobScene scene;
        scene.source = JobScene::Source::street;
        scene.objects = objects;
        scene.streets = given;
        scene.name = fmt::format("{}-{:06}", prefix.empty() ? "street" : prefix, seed);
        scene.streets.emplace_back("--seed", std::to_string(seed));
        scene.weight = uint64_t(metres * 10000);
        SR_CHECK(add_scene(streets, std::move(scene)));
    }
    return {};
}

Status JobReader::read_scene(const JobValue& table)
{
    SR_CHECK(check_keys(table, {"labels", "points", "streets", "objects", "name"}));
    const JobValue *labels = table.find("labels"), *points = table.find("points"), *streets = table.find("streets");
    if (!!labels + !!points + !!streets != 1)
        return refuse(table, "a scene has one of 'labels', 'points' and 'streets'");
    if (!points && job_.model.empty())
        return refuse(table, "a scene that is generated needs a 'model'");
    if (points && table.find("objects"))
        return refuse(*table.find("objects"), "'objects' have a meaning for a scene that is generated");
    if (streets)
        return add_streets(table, *streets);
    return labels ? add_files(table, "labels", JobScene::Source::labels)
                  : add_files(table, "points", JobScene::Source::points);
}

// files of a path whose name depends on the scene
Status JobReader::check_paths(const JobValue& at, const JobDrive& drive) const
{
    bool any = false;
    for (const JobScene& scene : job_.scenes) {
        if (!drive.scenes.empty() && !matches(drive.scenes, scene.name))
            continue;
        any = true;
        if (drive.made && scene.source != JobScene::Source::street)
            return refuse(
                at, fmt::format("'made': scene {} is no street that is made up: it needs a 'path'", quote(scene.name)));
        if (drive.made)
            break;
        std::string path = drive.path;
        if (const size_t where = path.find("{scene}"); where != std::string::npos)
            path.replace(where, 7, scene.name);
        if (!is_there(path))
            return refuse(at, fmt::format("'path': {} is not there", quote_path(path)));
        if (path == drive.path)
            break; // one for all
    }
    return any ? Status() : refuse(at, fmt::format("'scenes': no scene is {}", quote(drive.scenes)));
}

Status JobReader::read_drive(const JobValue& table, const CommandOptions& command, const std::vector<JobOption>& shared)
{
    JobDrive drive;
    SR_TRY(drive.name, text(table, "name"));
    if (drive.name.empty())
        drive.name = job_.drives.empty() ? "drive" : fmt::format("drive-{}", job_.drives.size() + 1);
    if (!is_folder_name(drive.name))
        return refuse(table,
                      fmt::format("{}: a drive's name is of letters, digits, '-', '_' and '.'", quote(drive.name)));
    if (std::ranges::count(job_.drives, drive.name, &JobDrive::name))
        return refuse(table, fmt::format("two drives have the name {}", quote(drive.name)));
    SR_TRY(drive.made, flag(table, "made", false));
    SR_TRY(const std::string path, text(table, "path"));
    if (drive.made == !path.empty())
        return refuse(table, "a drive has a 'path', or made = true, the street's own");
    drive.path = path.empty() ? path : resolve(path).string();
    SR_TRY(drive.scenes, text(table, "scenes"));
    SR_TRY(const std::string rig, text(table, "rig"));
    drive.rig = rig.empty() ? Path() : resolve(rig);
    if (!rig.empty() && !is_file(drive.rig))
        return refuse(*table.find("rig"), fmt::format("'rig': {} is not there", quote_path(drive.rig)));
    drive.options = shared;
    SR_TRY(const std::vector<JobOption> own, options(command, table, {"name", "made", "path", "scenes", "rig"}));
    for (const JobOption& option : own) {
        std::erase_if(drive.options, [&](const JobOption& o) { return o.first == option.first; });
        drive.options.push_back(option);
    }
    const JobValue* where = table.find("path") ? table.find("path") : table.find("made");
    SR_CHECK(check_paths(*where, drive));
    if (job_.refined)
        SR_CHECK(check_line(table, {"refine", "GRID", "-m", "MODEL", "-o", "OUT", "--path", "PATH"}, drive.options));
    else
        SR_CHECK(check_line(table, {"render", "GRID", "-o", "OUT", "--path", "PATH"}, drive.options));
    job_.drives.push_back(std::move(drive));
    return {};
}

Status JobReader::check_together(const JobValue& root) const
{
    if (job_.scenes.empty())
        return refuse(root, "a job has one [[scene]] at least");
    if (const JobValue* render = root.find("render"); render && job_.refined)
        return refuse(*render, "'render' has a meaning where 'refine' is false");
    if (const JobValue* refine = root.find("refine"); refine && !job_.refined)
        return refuse(*refine, "'refine' has a meaning where output.refine is not false");
    if (job_.refined && job_.model.empty())
        return refuse(root, "frames that are refined need a 'model'");
    return {};
}

// options that need or exclude each other
Status JobReader::check_line(const JobValue& at, std::vector<std::string> line,
                             const std::vector<JobOption>& options) const
{
    append_options(line, options);
    const Status taken = check_command(line);
    return taken ? taken : refuse(at, taken.error().message);
}

Status JobReader::read(const JobValue& root, const Path& out)
{
    job_.refined = root.find("refine") != nullptr;
    SR_CHECK(read_top(root, out));
    SR_CHECK(read_output(root.find("output")));
    SR_TRY(const auto scenes, tables(root, "scene"));
    for (const JobValue* scene : scenes)
        SR_CHECK(read_scene(*scene));
    SR_CHECK(check_together(root));
    if (const JobValue* generate = root.find("generate")) {
        SR_TRY(const auto command, CommandOptions::create("generate", {"model", "output", "seed", "objects", "along",
                                                                       "horizon", "ply", "ply-3dgs", "ply-2dgs"}));
        SR_TRY(job_.generate, options(command, *generate, {}));
        SR_CHECK(check_line(*generate, {"generate", "GRID", "-m", "MODEL"}, job_.generate));
    }
    const char* name = job_.refined ? "refine" : "render";
    SR_TRY(const auto command, CommandOptions::create(name, {"model", "output", "seed", "path", "rig", "frames", "from",
                                                             "video", "side-by-side", "fps", "top", "points"}));
    for (const auto& [option, value] : output_)
        if (!command.find(option.substr(2)))
            return refuse(*root.find("output"),
                          fmt::format("{} of pictures has no meaning for {}", option.substr(2), name));
    std::vector<JobOption> shared = output_;
    if (const JobValue* table = root.find(name)) {
        SR_TRY(const std::vector<JobOption> given, options(command, *table, {}));
        shared.insert(shared.end(), given.begin(), given.end());
    }
    SR_TRY(const auto drives, tables(root, "drive"));
    for (const JobValue* drive : drives)
        SR_CHECK(read_drive(*drive, command, shared));
    return {};
}

} // namespace

Result<JobFile> read_job_file(const Path& path, const Path& out)
{
    JobFile job;
    job.path = path;
    SR_TRY(const JobValue root, read_job_tree(path));
    SR_CHECK(JobReader(job).read(root, out));
    return job;
}

} // namespace semrover
