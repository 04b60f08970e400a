// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/measure/eval_sets.h"

#include "engine/scene/grid.h"
#include "runtime/base/final_name.h"
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"
#include "runtime/base/safetensors.h"
#include "tools/cli/open_device.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/progress.h"
#include "tools/cli/value_options.h"
#include "tools/eval/inception.h"
#include "tools/eval/pointnet.h"
#include "tools/eval/sample_files.h"

#include <algorithm>
#include <CLI/CLI.hpp>
#include <map>

namespace semrover {

namespace {

// Features of images of one or several sizes: those of one size wait until they fill a batch, rows come in the order of
// the images. At most six sizes are kept ready at a time.
class ImageBatches {
  public:
    // `images`: how many there will be
    ImageBatches(Device& device, const Inception& network, uint32_t batch, size_t images);

    Status add(ImageRgb8 image);          // the next one
    Result<Features> finish();            // once, after the last
    size_t done() const { return done_; } // that went through the network

    const std::map<std::pair<uint32_t, uint32_t>, size_t>& sizes() const { return sizes_; } // width, height: images

  private:
    struct Waiting {
        ImageSize size;
        std::unique_ptr<ImageFeatures> extractor;
        std::vector<ImageRgb8> images;
        std::vector<size_t> rows;
    };
    Status prepare(ImageSize size); // its Waiting is the last one
    Status flush(Waiting& waiting);

    Device* device_;
    const Inception* network_;
    uint32_t batch_;
    size_t images_, added_ = 0, done_ = 0;
    std::vector<Waiting> waiting_; // by last use
    std::map<std::pair<uint32_t, uint32_t>, size_t> sizes_;
    Features features_;
};

constexpr size_t kMostReady = 6; // sizes: each has a program and arrays on the device

ImageBatches::ImageBatches(Device& device, const Inception& network, uint32_t batch, size_t images)
    : device_(&device), network_(&network), batch_(batch), images_(images)
{
}

Status ImageBatches::add(ImageRgb8 image)
{
    SR_ASSERT(added_ < images_, "more than {} images", images_);
    const ImageSize size{image.width, image.height};
    SR_CHECK(prepare(size));
    ++sizes_[{size.width, size.height}];
    Waiting& w = waiting_.back();
    w.images.push_back(std::move(image));
    w.rows.push_back(added_++);
    return w.images.size() == w.extractor->batch() ? flush(w) : Status{};
}

Status ImageBatches::prepare(ImageSize size)
{
    const auto found = std::ranges::find(waiting_, size, &Waiting::size);
    if (found != waiting_.end()) {
        std::rotate(found, found + 1, waiting_.end());
        return {};
    }
    if (waiting_.size() == kMostReady) {
        SR_CHECK(flush(waiting_.front()));
        waiting_.erase(waiting_.begin());
    }
    Waiting w{size, nullptr, {}, {}};
    SR_TRY(w.extractor, ImageFeatures::create(*device_, *network_, size, batch_));
    waiting_.push_back(std::move(w));
    return {};
}

Status ImageBatches::flush(Waiting& w)
{
    if (w.images.empty())
        return {};
    Features rows;
    SR_CHECK(w.extractor->append(w.images, rows));
    features_.cols = rows.cols;
    features_.values.resize(images_ * rows.cols);
    for (size_t i = 0; i < w.rows.size(); ++i)
        std::copy_n(rows.row(i), rows.cols, &features_.values[w.rows[i] * rows.cols]);
    done_ += w.rows.size();
    w.images.clear();
    w.rows.clear();
    return {};
}

Result<Features> ImageBatches::finish()
{
    SR_ASSERT(added_ == images_, "{} images of {}", added_, images_);
    for (Waiting& w : waiting_)
        SR_CHECK(flush(w));
    features_.rows = uint32_t(images_);
    return std::move(features_);
}

namespace fs = std::filesystem;

constexpr uint32_t kImageBatch = 8, kChunkBatch = 4;
constexpr const char* kNames[] = {"A", "B"};

bool is_feature_file(const Path& path)
{
    return path.extension() == ".safetensors";
}

Result<EvalNetwork> network_kind(const Path& path)
{
    SR_TRY(const SafetensorsSet file, SafetensorsSet::open(path));
    if (file.find("Conv2d_1a_3x3.conv.weight"))
        return EvalNetwork::images;
    if (file.find("sa1.mlp_convs.0.weight"))
        return EvalNetwork::points;
    return fail(ErrorCode::bad_input,
                "{}: neither Inception v3 (Conv2d_1a_3x3.conv.weight) nor PointNet++ (sa1.mlp_convs.0.weight)",
                quote_path(path));
}

Status too_few(const std::string& set, uint64_t found, std::string_view what)
{
    return fail(ErrorCode::bad_input, "{}: {} {}, a comparison needs two or more", quote_path(set), found, what);
}

Status interrupted()
{
    return fail(ErrorCode::interrupted, "interrupted; nothing was written");
}

// ---- images

Status image_features(const EvalOptions& o, size_t side, Device& device, const Inception& network,
                      const Globals& globals, EvalSet& set)
{
    SR_TRY(const std::vector<Path> files, list_images(o.sets[side]));
    if (files.size() < 2)
        return too_few(o.sets[side], files.size(), "image");
    const uint32_t batch = std::min<uint32_t>(o.batch ? o.batch : kImageBatch, uint32_t(files.size()));
    ImageBatches batches(device, network, batch, files.size());
    Progress progress(progress_to_stderr(globals), fmt::format("features of {}", kNames[side]), "images", files.size());
    for (const Path& file : files) {
        SR_TRY(ImageRgb8 image, read_image(file));
        SR_CHECK(batches.add(std::move(image)));
        progress.update(batches.done(), device.allocated_bytes());
        if (interrupt_requested())
            return interrupted();
    }
    SR_TRY(set.features, batches.finish());
    progress.finish();
    set.description = {{"path", o.sets[side]}, {"kind", "images"}, {"samples", files.size()}};
    for (const auto& [size, images] : batches.sizes())
        set.description["sizes"].push_back({{"width", size.first}, {"height", size.second}, {"samples", images}});
    return {};
}

// ---- grids

Status check_colors(const ScenePoints& points, const PointnetConfig& config, const Path& file)
{
    if (points.colors.empty() && std::ranges::find(config.inputs, PointnetConfig::Input::rgb) != config.inputs.end())
        return fail(ErrorCode::bad_input, "{}: points without colours, which the network looks at (inputs: rgb)",
                    quote_path(file));
    return {};
}

Status chunk_features(const EvalOptions& o, size_t side, Device& device, const Pointnet& network,
                      const Globals& globals, EvalSet& set)
{
    SR_TRY(const std::vector<Path> files, list_grids(o.sets[side]));
    SR_TRY(const auto extractor, PointFeatures::create(device, network, o.batch ? o.batch : kChunkBatch));
    Features& features = set.features.emplace();
    features.cols = network.features();
    uint32_t left_out = 0;
    std::optional<Progress> progress; // of a single grid, in chunks
    for (size_t i = 0; i < files.size(); ++i) {
        SR_TRY(const PointFile file, read_points(files[i]));
        const ScenePoints& points = file.points;
        SR_CHECK(check_colors(points, network.config(), files[i]));
        if (file.dropped && !globals.quiet)
            print_stderr("semrover: warning: {}: {} points are not finite and left out\n", quote_path(files[i]),
                         file.dropped);
        SR_TRY(const PointChunks chunks, cut_chunks(points, network.config(), o.seed));
        left_out += chunks.left_out;
        const bool single = files.size() == 1;
        if (!progress)
            progress.emplace(progress_to_stderr(globals), fmt::format("features of {}", kNames[side]),
                             single ? "chunks" : "grids", single ? chunks.count : files.size());
        for (uint32_t first = 0; first < chunks.count; first += extractor->batch()) {
            SR_CHECK(extractor->append(chunks, first, std::min(extractor->batch(), chunks.count - first), features));
            progress->update(single ? features.rows : i, device.allocated_bytes());
            if (interrupt_requested())
                return interrupted();
        }
        progress->update(single ? features.rows : i + 1, device.allocated_bytes());
    }
    progress->finish();
    if (features.rows < 2)
        return too_few(
            o.sets[side], features.rows,
            fmt::format("chunk with {} points or more ({} with fewer)", network.config().min_points, left_out));
    set.description = {{"path", o.sets[side]},
                       {"kind", "chunks"},
                       {"samples", features.rows},
                       {"grids", files.size()},
                       {"left_out", left_out}};
    return {};
}

// ---- both

Status read_feature_file(const std::string& path, EvalSet& set)
{
    SR_TRY(const FeatureFile kind, feature_file_kind(path));
    if (kind == FeatureFile::gaussian) {
        SR_TRY(set.moments, read_gaussian(path));
        set.description = {{"path", path}, {"kind", "moments"}};
        return {};
    }
    SR_TRY(set.features, read_features(path));
    if (set.features->rows < 2)
        return too_few(path, set.features->rows, "sample");
    set.description = {{"path", path}, {"kind", "features"}, {"samples", set.features->rows}};
    return {};
}

Path saved_path(const EvalOptions& o, size_t side)
{
    return Path(o.save) / (side ? "b.safetensors" : "a.safetensors");
}

Status check_outputs(const EvalOptions& o, const Globals& globals)
{
    for (size_t side = 0; side < 2 && !o.save.empty(); ++side)
        SR_CHECK(refuse_existing(saved_path(o, side), globals.yes));
    return {};
}

Status save(const EvalOptions& o, size_t side, const EvalSet& set)
{
    SR_CHECK(make_folder(o.save));
    return write_features(saved_path(o, side), *set.features);
}

Status compute_features(const EvalOptions& o, std::optional<EvalNetwork> only, const Globals& globals, EvalSets& y)
{
    SR_TRY(const EvalNetwork kind, network_kind(o.network));
    if (only && kind != *only)
        return fail(ErrorCode::bad_input, "{}: {} is needed here, this is {}", quote_path(o.network),
                    *only == EvalNetwork::images ? "an Inception v3 network" : "a PointNet++",
                    kind == EvalNetwork::images ? "an Inception v3 network" : "a PointNet++");
    SR_TRY(const uint64_t hash, hash_file(o.network));
    SR_TRY(const auto device, open_device(globals));
    std::unique_ptr<Inception> inception;
    std::unique_ptr<Pointnet> pointnet;
    std::vector<std::string> warnings;
    if (kind == EvalNetwork::images) {
        SR_TRY(inception, Inception::load(*device, o.network));
    } else {
        SR_TRY(pointnet, Pointnet::load(*device, o.network, warnings));
    }
    for (const std::string& warning : warnings)
        print_stderr("semrover: warning: {}\n", warning);
    for (size_t side = 0; side < 2; ++side) {
        if (is_feature_file(o.sets[side]))
            continue;
        SR_CHECK(inception ? image_features(o, side, *device, *inception, globals, y.set[side])
                           : chunk_features(o, side, *device, *pointnet, globals, y.set[side]));
        y.set[side].features->network = hash_text(hash);
    }
    for (size_t side = 0; side < 2 && !o.save.empty(); ++side)
        if (!is_feature_file(o.sets[side]))
            SR_CHECK(save(o, side, y.set[side]));
    y.report["network"] = {
        {"path", o.network}, {"kind", inception ? "inception_v3" : "pointnet2"}, {"hash", hash_text(hash)}};
    y.report["device"] = device->name();
    y.report["peak_bytes"] = device->peak_bytes();
    return {};
}

uint32_t width_of(const EvalSet& set)
{
    return set.features ? set.features->cols : set.moments->size;
}

} // namespace

void add_eval_options(CLI::App& command, EvalOptions& o)
{
    command.add_option("A", o.sets[0], "images, grids, clouds (.ply), or a .safetensors file of features or moments")
        ->required();
    command.add_option("B", o.sets[1], "the set to compare with, of the same kind")->required();
    command.add_option("--features", o.network, "the network: safetensors (docs/eval.md has the layouts)");
    command.add_option("--save-features", o.save, "a folder to write a.safetensors and b.safetensors to");
    add_number(command, "--batch", o.batch, "images or chunks at a time (default: 8 images, 4 chunks)", 1u, 1024u);
    add_seed(command, "--seed", o.seed, "of what is drawn at random (0)");
}

Result<EvalSets> load_eval_sets(const EvalOptions& o, std::optional<EvalNetwork> only, const Globals& globals)
{
    SR_CHECK(check_outputs(o, globals));
    EvalSets y;
    std::array<ShardsOrNone, 2> shards; // that the images are in
    bool compute = false;
    for (size_t side = 0; side < 2; ++side) {
        const std::string& path = o.sets[side];
        SR_TRY(shards[side], open_if_shards(path));
        if (!is_there(path))
            return fail(ErrorCode::bad_input, "{}: no such file or folder", quote_path(path));
        if (is_feature_file(path))
            SR_CHECK(read_feature_file(path, y.set[side]));
        else
            compute = true;
        if (!is_feature_file(path) && o.network.empty())
            return fail(ErrorCode::usage, "{} has no features yet: --features NETWORK.safetensors is needed",
                        quote_path(path));
    }
    if (compute)
        SR_CHECK(compute_features(o, only, globals, y));
    const uint32_t a = width_of(y.set[0]), b = width_of(y.set[1]);
    if (a != b)
        return fail(ErrorCode::bad_input, "{} has {} features a sample, {} has {}: of different networks",
                    quote_path(o.sets[0]), a, quote_path(o.sets[1]), b);
    if (y.set[0].features && y.set[1].features) {
        const std::string &first = y.set[0].features->network, &second = y.set[1].features->network;
        if (!first.empty() && !second.empty() && first != second)
            return fail(ErrorCode::bad_input, "features of different networks: {} of {}, {} of {}",
                        quote_path(o.sets[0]), quote(first), quote_path(o.sets[1]), quote(second));
    }
    y.report["a"] = y.set[0].description;
    y.report["b"] = y.set[1].description;
    y.report["features"] = a;
    return y;
}

Status require_features(const EvalSets& sets, std::string_view metric)
{
    for (const EvalSet& set : sets.set)
        if (!set.features)
            return fail(ErrorCode::bad_input, "{}: moments are not enough for {}, which needs features",
                        quote_path(set.description["path"].get<std::string>()), metric);
    return {};
}

std::string sets_text(const EvalSets& sets)
{
    std::string text;
    for (const EvalSet& set : sets.set)
        text += set.features
                    ? fmt::format("{} {}, ", set.features->rows,
                                  set.description["kind"] == "features" ? "samples"
                                                                        : set.description["kind"].get<std::string>())
                    : "moments, ";
    return text + fmt::format("{} features", sets.report["features"].get<uint32_t>());
}

} // namespace semrover
