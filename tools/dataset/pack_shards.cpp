// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/pack_shards.h"

#include "engine/shards/shard_set.h"
#include "engine/shards/ustar.h"
#include "runtime/base/final_name.h"
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <set>

namespace semrover {

namespace {

namespace fs = std::filesystem;

struct PackedPicture {
    uint32_t moment = 0;
    std::string name, path; // in the archive, in the folder
    uint64_t size = 0;
};

struct PackedFolder {
    std::vector<PackedPicture> pictures; // by moment, then name
    std::vector<std::string> files;      // the others, sorted
    uint64_t bytes = 0;                  // of all
};

bool is_temporary(const Path& file)
{
    return file.filename().string().starts_with(".semrover-") && file.extension() == ".tmp";
}

Status add_file(const Path& path, std::string relative, const std::string& key_prefix, PackedFolder& found)
{
    std::error_code error;
    const uint64_t size = fs::file_size(path, error);
    if (error)
        return fail(ErrorCode::bad_input, "cannot read {}: {}", quote_path(path), error.message());
    found.bytes += size;
    if (found.pictures.size() + found.files.size() == kMostShardFiles)
        return fail(ErrorCode::bad_input, "{} is file {}, a set holds {}", quote_path(path), kMostShardFiles + 1,
                    kMostShardFiles);
    const auto picture = shard_picture(relative);
    if (!picture) {
        if (relative == kShardIndexName || is_shard_name(relative) || printable(relative, relative.size()) != relative)
            return fail(ErrorCode::bad_input, "{}: expected a printable name in UTF-8, and none of a set's own",
                        quote_path(path));
        found.files.push_back(std::move(relative));
        return {};
    }
    std::string name = member_name(key_prefix, *picture);
    if (name.size() > kMostTarName || size > kMostTarFile)
        return fail(ErrorCode::bad_input,
                    "{}: {} of {} bytes, an archive holds names of up to {} and files of up to {}", quote_path(path),
                    quote(name), size, kMostTarName, kMostTarFile);
    found.pictures.push_back({picture->moment, std::move(name), std::move(relative), size});
    return {};
}

// what killed processes were writing is left out
Result<PackedFolder> find_files(const Path& folder, const ShardOptions& options)
{
    PackedFolder found;
    std::error_code error;
    for (fs::recursive_directory_iterator i(folder, error), end; !error && i != end; i.increment(error)) {
        std::error_code ignored;
        const bool skipped = i.depth() == 0 && std::ranges::count(options.skip, i->path().filename().string());
        if (skipped)
            i.disable_recursion_pending();
        if (skipped || (i->is_directory(ignored) && !i->is_symlink(ignored)))
            continue;
        if (!i->is_regular_file(ignored))
            return fail(ErrorCode::bad_input, "{}: expected a file or a folder, found a link or a device",
                        quote_path(i->path()));
        if (!is_temporary(i->path()))
            SR_CHECK(
                add_file(i->path(), i->path().lexically_relative(folder).generic_string(), options.key_prefix, found));
    }
    if (error)
        return fail(ErrorCode::bad_input, "cannot list {}: {}", quote_path(folder), error.message());
    if (found.pictures.empty())
        return fail(ErrorCode::bad_input, "{} holds no pictures [CAMERA/]KIND/NNNNNN.ENDING", quote_path(folder));
    std::ranges::sort(found.files);
    const auto key = [](const PackedPicture& p) { return std::tie(p.moment, p.name, p.path); };
    std::ranges::sort(found.pictures, {}, key);
    const auto twin = std::ranges::adjacent_find(found.pictures, {}, &PackedPicture::name);
    if (twin != found.pictures.end())
        return fail(ErrorCode::bad_input, "{} and {} would both be {}", quote_path(folder / twin->path),
                    quote_path(folder / std::next(twin)->path), quote(twin->name));
    return found;
}

Status remove_file(const Path& path)
{
    std::error_code error;
    fs::remove(path, error);
    if (error)
        return fail(ErrorCode::bad_input, "cannot remove {}: {}", quote_path(path), error.message());
    return {};
}

// makes room for a set: removes one that may be replaced, its index first, and what was not finished
Status empty_output(const Path& output, const std::vector<std::string>& files, bool replace)
{
    SR_CHECK(make_folder(output));
    std::set<std::string> ours(files.begin(), files.end());
    SR_CHECK(refuse_existing(output / kShardIndexName, replace));
    if (is_file(output / kShardIndexName)) {
        SR_TRY(const ShardIndex before, read_shard_index(output));
        SR_CHECK(remove_file(output / kShardIndexName));
        for (const ShardMember& file : before.files)
            ours.insert(file.path);
    }
    SR_TRY(const std::vector<Path> there, list_tree(output));
    const auto is_ours = [&](const Path& path) {
        const std::string relative = path.lexically_relative(output).generic_string();
        return is_shard_name(relative) || is_temporary(path) || ours.contains(relative);
    };
    for (const Path& path : there)
        if (!is_ours(path))
            return fail(ErrorCode::usage, "{} is not of the set that is packed: expected an empty folder",
                        quote_path(path));
    for (const Path& path : there)
        SR_CHECK(remove_file(path));
    return {};
}

class Packer {
  public:
    Packer(const Path& folder, const Path& output, const ShardOptions& options, uint64_t total)
        : folder_(folder), output_(output), options_(options), total_(total)
    {
        index_.key_prefix = options.key_prefix;
    }

    // all pictures of a moment
    Status add_moment(std::span<const PackedPicture> pictures)
    {
        uint64_t bytes = 0;
        for (const PackedPicture& p : pictures)
            bytes += kTarBlock + tar_padded(p.size);
        if (archive_ && index_.shards.back().bytes + bytes + kTarEnd > options_.shard_bytes)
            SR_CHECK(end_archive());
        if (!archive_) {
            if (index_.shards.size() == kMostShards)
                return fail(ErrorCode::usage, "`shard_size` {} makes more than {} archives", options_.shard_bytes,
                            kMostShards);
            SR_TRY(AtomicFile file, AtomicFile::create(output_ / shard_name(index_.shards.size())));
            archive_.emplace(std::move(file));
            index_.shards.emplace_back();
        }
        ++info_.moments;
        for (const PackedPicture& p : pictures)
            SR_CHECK(add_picture(p));
        return {};
    }

    Status add_file(const std::string& path)
    {
        const Path to = output_ / path;
        SR_CHECK(make_folder(to.parent_path()));
        SR_TRY(AtomicFile copy, AtomicFile::create(to));
        ShardMember& member = index_.files.emplace_back();
        member.path = path;
        SR_CHECK(copy_into(copy, member));
        return copy.commit();
    }

    Result<ShardSetInfo> finish()
    {
        SR_CHECK(end_archive());
        SR_CHECK(write_shard_index(output_, index_));
        for (const Shard& shard : index_.shards) {
            info_.pictures += shard.members.size();
            info_.bytes += shard.bytes;
        }
        info_.shards = index_.shards.size();
        info_.files = index_.files.size();
        return info_;
    }

  private:
    // the bytes of member.path, whose size and hash become known
    Status copy_into(AtomicFile& to, ShardMember& member)
    {
        SR_TRY(const MappedFile from, MappedFile::open(folder_ / member.path));
        member.size = from.bytes().size();
        Hash hash;
        hash.add(from.bytes());
        member.hash = hash.value();
        done_ += member.size;
        SR_CHECK(to.write(from.bytes()));
        return options_.progress ? options_.progress(done_, total_) : Status{};
    }

    Status add_picture(const PackedPicture& p)
    {
        Shard& shard = index_.shards.back();
        const TarHeader header = tar_header(p.name, p.size);
        SR_CHECK(archive_->write(std::string_view(header.data(), header.size())));
        ShardMember& member = shard.members.emplace_back();
        member.path = p.path;
        member.offset = shard.bytes + kTarBlock;
        SR_CHECK(copy_into(*archive_, member));
        if (member.size != p.size)
            return fail(ErrorCode::bad_input, "{} changed from {} to {} bytes while it was packed",
                        quote_path(folder_ / p.path), p.size, member.size);
        shard.bytes = member.offset + tar_padded(p.size);
        return archive_->write(std::string_view(kZeros.data(), tar_padded(p.size) - p.size));
    }

    Status end_archive()
    {
        index_.shards.back().bytes += kTarEnd;
        SR_CHECK(archive_->write(std::string_view(kZeros.data(), kTarEnd)));
        SR_CHECK(archive_->commit());
        archive_.reset();
        return {};
    }

    static constexpr std::array<char, kTarEnd> kZeros{};
    const Path &folder_, &output_;
    const ShardOptions& options_;
    uint64_t total_, done_ = 0;
    std::optional<AtomicFile> archive_; // of the last shard
    ShardIndex index_;
    ShardSetInfo info_;
};

// neither lies in the other
Status check_folders(const Path& folder, const Path& output)
{
    if (!is_folder(folder))
        return fail(ErrorCode::bad_input, "{}: expected a folder of pictures", quote_path(folder));
    SR_TRY(const ShardsOrNone set, open_if_shards(folder));
    if (set)
        return fail(ErrorCode::bad_input, "{} is a shard set, expected a folder of pictures", quote_path(folder));
    std::error_code error, other_error;
    const Path from = fs::weakly_canonical(folder, error), to = fs::weakly_canonical(output, other_error);
    const auto apart = std::ranges::mismatch(from, to);
    error = error ? error : other_error;
    if (error)
        return fail(ErrorCode::bad_input, "cannot examine {} or {}: {}", quote_path(folder), quote_path(output),
                    error.message());
    if (apart.in1 == from.end() || apart.in2 == to.end())
        return fail(ErrorCode::usage, "{} and {}: expected folders of which neither is in the other",
                    quote_path(folder), quote_path(output));
    return {};
}

} // namespace

Result<ShardSetInfo> pack_shards(const Path& folder, const Path& output, const ShardOptions& options)
{
    if (!is_key_prefix(options.key_prefix))
        return fail(ErrorCode::usage, "`key` is {}, expected up to 48 letters, digits, '_' and '-'",
                    quote(options.key_prefix));
    SR_CHECK(check_folders(folder, output));
    SR_TRY(const PackedFolder found, find_files(folder, options));
    SR_CHECK(empty_output(output, found.files, options.replace));
    Packer packer(folder, output, options, found.bytes);
    for (auto p = found.pictures.begin(); p != found.pictures.end();) {
        const auto end = std::ranges::find_if(p, found.pictures.end(),
                                              [&](const PackedPicture& o) { return o.moment != p->moment; });
        SR_CHECK(packer.add_moment({p, end}));
        p = end;
    }
    for (const std::string& file : found.files)
        SR_CHECK(packer.add_file(file));
    return packer.finish();
}

} // namespace semrover
