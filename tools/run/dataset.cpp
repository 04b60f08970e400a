// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover dataset pack|list|verify|unpack: folders of pictures as archives of many moments each, and back;
// semrover dataset export: drives in the layouts of other programs
#include "runtime/base/hash.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/output_folder.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/progress.h"
#include "tools/cli/value_options.h"
#include "tools/dataset/check_shards.h"
#include "tools/dataset/pack_shards.h"
#include "tools/export/exporters.h"

#include <CLI/CLI.hpp>
#include <map>
#include <set>

namespace semrover {

namespace {

// how far bytes are; an error where the user stops it
class BytesProgress {
  public:
    BytesProgress(const Globals& globals, const char* stage) : globals_(globals), stage_(stage) {}

    Status operator()(uint64_t done, uint64_t total)
    {
        if (!progress_)
            progress_.emplace(progress_to_stderr(globals_), stage_, "bytes", total);
        progress_->update(done);
        if (interrupt_requested())
            return fail(ErrorCode::interrupted, "interrupted after {} of {} bytes", done, total);
        return {};
    }

  private:
    const Globals& globals_;
    const char* stage_;
    std::optional<Progress> progress_;
};

// ---- pack

struct PackArguments {
    std::string folder, output;
    ShardOptions options;
};

Status pack(const PackArguments& o, const Globals& globals)
{
    BytesProgress progress(globals, "pack");
    ShardOptions options = o.options;
    options.replace = globals.yes;
    options.progress = std::ref(progress);
    SR_TRY(const ShardSetInfo info, pack_shards(o.folder, o.output, options));
    if (globals.json)
        fmt::print("{}\n", json_text(Json{{"moments", info.moments},
                                          {"pictures", info.pictures},
                                          {"shards", info.shards},
                                          {"bytes", info.bytes},
                                          {"files", info.files}}));
    else if (!globals.quiet)
        fmt::print("{}: {} moments, {} pictures in {} shards of {}, {} other files\n", quote_path(o.output),
                   info.moments, info.pictures, info.shards, bytes_text(info.bytes), info.files);
    return {};
}

// ---- list

struct CameraContents {
    uint32_t first = UINT32_MAX, last = 0;
    std::map<std::string, uint64_t> kinds; // pictures
};

Json contents_json(const ShardIndex& index)
{
    std::map<std::string, CameraContents> cameras;
    std::set<uint32_t> moments;
    uint64_t bytes = 0, pictures = 0;
    for (const Shard& shard : index.shards) {
        bytes += shard.bytes;
        pictures += shard.members.size();
        for (const ShardMember& member : shard.members) {
            const ShardPicture name = *shard_picture(member.path);
            CameraContents& c = cameras[name.camera];
            c.first = std::min(c.first, name.moment);
            c.last = std::max(c.last, name.moment);
            ++c.kinds[name.kind];
            moments.insert(name.moment);
        }
    }
    Json report{{"key_prefix", index.key_prefix},
                {"moments", moments.size()},
                {"pictures", pictures},
                {"shards", index.shards.size()},
                {"bytes", bytes},
                {"files", Json::array()}};
    for (const auto& [name, c] : cameras)
        report["cameras"].push_back({{"name", name}, {"first", c.first}, {"last", c.last}, {"kinds", c.kinds}});
    for (const ShardMember& file : index.files)
        report["files"].push_back(file.path);
    return report;
}

Status list(const std::string& folder, const Globals& globals)
{
    SR_TRY(const auto set, ShardSet::open(folder));
    const Json report = contents_json(set->index());
    if (globals.json) {
        fmt::print("{}\n", json_text(report));
        return {};
    }
    fmt::print("{} moments, {} pictures in {} shards of {}, {} other files\n", report["moments"].get<uint64_t>(),
               report["pictures"].get<uint64_t>(), report["shards"].get<uint64_t>(),
               bytes_text(report["bytes"].get<uint64_t>()), report["files"].size());
    for (const Json& camera : report["cameras"]) {
        const std::string name = camera["name"];
        fmt::print("{:<16} {:06} to {:06}", name.empty() ? "(no name)" : name, camera["first"].get<uint32_t>(),
                   camera["last"].get<uint32_t>());
        for (const auto& [kind, pictures] : camera["kinds"].items())
            fmt::print("  {} {}", pictures.get<uint64_t>(), kind);
        fmt::print("\n");
    }
    return {};
}

// ---- verify

Status verify_set(const std::string& folder, const Globals& globals)
{
    SR_TRY(const auto set, ShardSet::open(folder));
    BytesProgress progress(globals, "verify");
    SR_TRY(const std::vector<ShardFault> faults, check_shards(*set, std::ref(progress)));
    Json report{{"shards", set->index().shards.size()}, {"faults", Json::array()}};
    for (const ShardFault& fault : faults) {
        report["faults"].push_back({{"path", fault.path}, {"what", fault.what}});
        if (!globals.json)
            fmt::print("{}: {}\n", printable(fault.path), fault.what);
    }
    if (globals.json)
        fmt::print("{}\n", json_text(report));
    if (!faults.empty())
        return fail(ErrorCode::bad_input, "{}: {} faults, the first: {}: {}", quote_path(folder), faults.size(),
                    printable(faults[0].path), faults[0].what);
    if (!globals.json && !globals.quiet)
        fmt::print("{}: all is as the index says\n", quote_path(folder));
    return {};
}

// ---- unpack

Status unpack_file(const Path& to, const ShardMember& member, std::span<const std::byte> bytes)
{
    Hash hash;
    hash.add(bytes);
    if (bytes.size() != member.size || hash.value() != member.hash)
        return fail(ErrorCode::bad_input, "{} is not as the index says: its size or hash is another",
                    quote(member.path));
    SR_CHECK(make_folder(to.parent_path()));
    return write_file_atomically(to, bytes);
}

Status unpack(const std::string& folder, const std::string& output, const Globals& globals)
{
    SR_TRY(const auto set, ShardSet::open(folder));
    SR_TRY(OutputFolder out, OutputFolder::create(output, globals.yes));
    BytesProgress progress(globals, "unpack");
    uint64_t total = 0, done = 0;
    for (const Shard& shard : set->index().shards)
        total += shard.bytes;
    for (size_t i = 0; i < set->index().shards.size(); ++i)
        for (const ShardMember& member : set->index().shards[i].members) {
            SR_CHECK(unpack_file(out / member.path, member, set->bytes(i, member)));
            SR_CHECK(progress(done += member.size, total));
        }
    for (const ShardMember& member : set->index().files) {
        SR_TRY(const MappedFile file, MappedFile::open(set->folder() / member.path));
        SR_CHECK(unpack_file(out / member.path, member, file.bytes()));
    }
    return out.commit();
}

// ---- export

struct ExportArguments {
    std::vector<std::string> sets;
    std::string layout, output;
    ExportOptions options;
};

Status export_sets(const ExportArguments& o, const Globals& globals)
{
    const auto layout = std::ranges::find(kExporters, std::string_view(o.layout), &NamedExporter::name);
    if (o.sets.size() > 1 && !layout->several)
        return fail(ErrorCode::usage, "--to {} is of one drive, not of {}", o.layout, o.sets.size());
    std::vector<DriveInput> drives;
    for (const std::string& set : o.sets) {
        SR_TRY(drives.emplace_back(), open_drive(set));
    }
    SR_TRY(OutputFolder out, OutputFolder::create(o.output, globals.yes));
    SR_TRY(const ExportReport report, layout->run(drives, out.path(), o.options));
    SR_CHECK(out.commit());
    print_warnings(report.warnings, globals);
    if (globals.json)
        fmt::print("{}\n", json_text(Json{{"pictures", report.pictures},
                                          {"boxes", report.boxes},
                                          {"scans", report.scans},
                                          {"left_out", report.left_out}}));
    else if (!globals.quiet) {
        fmt::print("{}: {} drives, {} pictures, {} boxes as {}\n", quote_path(o.output), drives.size(), report.pictures,
                   report.boxes, o.layout);
        for (const auto& [name, count] : report.left_out)
            fmt::print("  left out, as {} has no class for it: {} of {}\n", o.layout, count, name);
    }
    return {};
}

void add_export(CLI::App& dataset, const Globals& globals, Run& run)
{
    auto o = std::make_shared<ExportArguments>();
    CLI::App* c = dataset.add_subcommand("export", "drives in the layout of another program");
    c->add_option("SET", o->sets, "what `render` or `refine` wrote, or shard sets of it")->required();
    std::vector<std::string> names;
    for (const NamedExporter& exporter : kExporters)
        names.push_back(exporter.name);
    add_choice(*c, "--to", names, "the layout", o->layout)->required();
    c->add_option("-o,--output", o->output, "folder of the data set")->required();
    c->add_option("--camera", o->options.camera, "of kitti: the camera that image_2 is of; by default the first");
    add_number(*c, "--val", o->options.val, "of kitti and nuscenes: how many of the sets, the last ones, validate", 0u,
               100000u);
    add_number(*c, "--quality", o->options.quality, "of JPEGs that are made of PNGs", 1, 100);
    c->callback([o, &globals, &run] { run = [o, &globals] { return export_sets(*o, globals); }; });
}

} // namespace

void add_dataset(CLI::App& app, const Globals& globals, Run& run)
{
    CLI::App* dataset = app.add_subcommand("dataset", "folders of pictures as a few archives, and back");
    dataset->require_subcommand(1);
    dataset->fallthrough();

    auto o = std::make_shared<PackArguments>();
    CLI::App* c = dataset->add_subcommand("pack", "a folder of pictures to a shard set: archives and their index");
    c->add_option("DIR", o->folder, "what `render` or `refine` wrote, or pictures laid out so")->required();
    c->add_option("-o,--output", o->output, "folder of the set")->required();
    c->add_option("--key", o->options.key_prefix, "in front of each moment's number, such as SCENE_DRIVE_");
    c->add_option_function<std::string>(
         "--shard-size",
         [o](const std::string& text) {
             const auto bytes = parse_memory_size(text);
             if (!bytes)
                 throw CLI::ValidationError("--shard-size", bytes.error().message);
             o->options.shard_bytes = *bytes;
         },
         "bytes of an archive at most: 512MiB, 1G; a moment is never in two")
        ->default_str("512MiB");
    c->callback([o, &globals, &run] { run = [o, &globals] { return pack(*o, globals); }; });

    auto set = std::make_shared<std::string>(), output = std::make_shared<std::string>();
    add_export(*dataset, globals, run);

    c = dataset->add_subcommand("list", "moments, cameras, kinds of pictures and archives of a shard set");
    c->add_option("SET", *set, "folder of a shard set")->required();
    c->callback([set, &globals, &run] { run = [set, &globals] { return list(*set, globals); }; });

    c = dataset->add_subcommand("verify", "compare all bytes of a shard set with its index");
    c->add_option("SET", *set, "folder of a shard set")->required();
    c->callback([set, &globals, &run] { run = [set, &globals] { return verify_set(*set, globals); }; });

    c = dataset->add_subcommand("unpack", "the folder that a shard set was packed from");
    c->add_option("SET", *set, "folder of a shard set")->required();
    c->add_option("-o,--output", *output, "folder")->required();
    c->callback(
        [set, output, &globals, &run] { run = [set, output, &globals] { return unpack(*set, *output, globals); }; });
}

} // namespace semrover
