// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/shards/shard_index.h"

#include "engine/camera/camera.h"
#include "engine/shards/ustar.h"
#include "runtime/base/hash.h"
#include "runtime/base/inner_path.h"
#include "runtime/base/json_fields.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <charconv>
#include <tuple>

namespace semrover {

namespace {

constexpr uint32_t kVersion = 1;
constexpr JsonLimits kIndexLimits{.bytes = 256u << 20, .depth = 8, .values = 8u << 20, .containers = 2u << 20};

constexpr std::string_view kNuscenesPoints = "pcd.bin"; // as nuScenes calls them

bool are_alphanumeric(std::string_view text)
{
    return !text.empty() && std::ranges::all_of(text, [](unsigned char c) {
        return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
    });
}

// "000012", "1000000": as frames are numbered
std::optional<uint32_t> moment_of(std::string_view digits)
{
    uint32_t number = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
    const bool whole = error == std::errc() && end == digits.data() + digits.size();
    if (!whole || digits.size() < 6 || digits.size() > 9 || (digits.size() > 6 && digits[0] == '0'))
        return std::nullopt;
    return number;
}

std::string row_text(const ShardMember& m, bool with_offset)
{
    const std::string offset = with_offset ? fmt::format("{}, ", m.offset) : "";
    return fmt::format("[{}, {}{}, \"{}\"]", json_text(Json(m.path)), offset, m.size, hash_text(m.hash));
}

void append_rows(std::string& text, const std::vector<ShardMember>& members, bool with_offset)
{
    for (size_t i = 0; i < members.size(); ++i)
        text += fmt::format("{}\n  {}", i ? "," : "", row_text(members[i], with_offset));
}

// bad_input with the place in front of what is said there
template <typename... Args>
tl::unexpected<Error> wrong(std::string_view where, fmt::format_string<Args...> format, Args&&... args)
{
    return fail(ErrorCode::bad_input, "{}: {}", where, fmt::format(format, std::forward<Args>(args)...));
}

Result<uint64_t> read_hash(const Json& value, std::string_view where)
{
    const std::string* text = value.get_ptr<const std::string*>();
    uint64_t hash = 0;
    if (text && text->size() == 16 &&
        std::from_chars(text->data(), text->data() + 16, hash, 16).ptr == text->data() + 16 && hash_text(hash) == *text)
        return hash;
    return wrong(where, "expected a hash of 16 hexadecimal digits, found {}", quote(json_text(value), 60));
}

// an object with these keys and no other
Status check_object(const Json& json, std::initializer_list<std::string_view> keys, std::string_view where)
{
    if (!json.is_object())
        return wrong(where, "expected an object, found {}", json.type_name());
    for (const std::string_view key : keys)
        if (!json.contains(key))
            return wrong(where, "{} is missing", key);
    return check_keys(json, std::span(keys.begin(), keys.size()), where);
}

// [path, size, hash], of archives [path, offset, size, hash]
Result<ShardMember> read_row(const Json& row, bool with_offset, std::string_view where)
{
    const size_t numbers = with_offset ? 2 : 1;
    if (!row.is_array() || row.size() != numbers + 2 || !row[0].is_string())
        return wrong(where, "expected a list of path, {}size and hash", with_offset ? "offset, " : "");
    ShardMember member{row[0].get<std::string>()};
    for (size_t i = 1; i <= numbers; ++i)
        if (!row[i].is_number_unsigned())
            return wrong(where, "expected a whole number of bytes, found {}", quote(json_text(row[i]), 60));
    member.offset = with_offset ? row[1].get<uint64_t>() : 0;
    member.size = row[numbers].get<uint64_t>();
    SR_TRY(member.hash, read_hash(row.back(), where));
    return member;
}

// Adds a member behind those of a shard, which end at `end`
Status add_member(ShardMember member, std::string_view key_prefix, uint64_t& end, Shard& shard, std::string_view where)
{
    const auto name = shard_picture(member.path);
    if (!name)
        return wrong(where, "expected a path [CAMERA/]KIND/NNNNNN.ENDING, found {}", quote(member.path));
    if (member_name(key_prefix, *name).size() > kMostTarName || member.size > kMostTarFile)
        return wrong(where, "{} of {} bytes is more than an archive holds", quote(member.path), member.size);
    if (member.offset != end + kTarBlock)
        return wrong(where, "{} has the offset {}, expected {}: a block behind the one before", quote(member.path),
                     member.offset, end + kTarBlock);
    end = member.offset + tar_padded(member.size);
    if (end + kTarEnd > shard.bytes)
        return wrong(where, "{} ends at byte {}, the archive has {}", quote(member.path), end, shard.bytes);
    shard.members.push_back(std::move(member));
    return {};
}

Result<Shard> read_shard(const Json& json, size_t number, std::string_view key_prefix, std::string_view file)
{
    const std::string where = fmt::format("{}: {}", file, shard_name(number));
    SR_CHECK(check_object(json, {"file", "bytes", "members"}, where));
    if (json["file"] != shard_name(number))
        return wrong(where, "file is {}, expected this name", quote(json_text(json["file"]), 60));
    SR_CHECK(check_array(json["members"], "members", where));
    Shard shard;
    const Json& bytes = json["bytes"];
    if (!bytes.is_number_unsigned() || bytes.get<uint64_t>() % kTarBlock)
        return wrong(where, "bytes is {}, expected a multiple of {}", quote(json_text(bytes), 60), kTarBlock);
    shard.bytes = bytes.get<uint64_t>();
    uint64_t end = 0;
    for (const Json& row : json["members"]) {
        const std::string place = fmt::format("{} member {}", where, shard.members.size());
        SR_TRY(ShardMember member, read_row(row, true, place));
        SR_CHECK(add_member(std::move(member), key_prefix, end, shard, place));
    }
    if (shard.members.empty() || end + kTarEnd != shard.bytes)
        return wrong(where, "its {} members end at byte {}, the archive has {}, expected {} more for its end",
                     shard.members.size(), end, shard.bytes, kTarEnd);
    return shard;
}

// moments ascend, names ascend within one, and a new archive begins with a new moment
Status check_order(const ShardIndex& index, std::string_view file)
{
    std::optional<std::pair<uint32_t, std::string>> before;
    for (const Shard& shard : index.shards) {
        const std::optional<uint32_t> split = before ? std::optional(before->first) : std::nullopt;
        for (const ShardMember& member : shard.members) {
            const ShardPicture name = *shard_picture(member.path);
            std::pair<uint32_t, std::string> now{name.moment, member_name(index.key_prefix, name)};
            if (split == now.first)
                return wrong(file, "moment {} is in two archives", now.first);
            if (before && now <= *before)
                return wrong(file, "{} is behind {}, expected members in order, each once", quote(now.second),
                             quote(before->second));
            before = std::move(now);
        }
    }
    return {};
}

bool is_member_path(const std::string& path)
{
    const Path p(path);
    return leads_inside(path) && p == p.lexically_normal() && p.has_filename() && p != "." && p != kShardIndexName &&
           !is_shard_name(path);
}

Status read_files(const Json& json, ShardIndex& index, std::string_view file)
{
    SR_CHECK(check_array(json, "files", file));
    for (const Json& row : json) {
        const std::string place = fmt::format("{}: file {}", file, index.files.size());
        SR_TRY(ShardMember member, read_row(row, false, place));
        if (!is_member_path(member.path) || shard_picture(member.path))
            return wrong(place, "expected the path of another file inside the folder, found {}", quote(member.path));
        if (!index.files.empty() && member.path <= index.files.back().path)
            return wrong(place, "{} is behind {}, expected files in order, each once", quote(member.path),
                         quote(index.files.back().path));
        index.files.push_back(std::move(member));
    }
    return {};
}

} // namespace

std::string shard_name(size_t number)
{
    return fmt::format("frames-{:05}.tar", number);
}

bool is_shard_name(std::string_view name)
{
    uint32_t number = 0;
    return name.size() == shard_name(0).size() && name.starts_with("frames-") &&
           std::from_chars(name.data() + 7, name.data() + 12, number).ec == std::errc() && name == shard_name(number);
}

std::optional<ShardPicture> shard_picture(std::string_view path)
{
    std::vector<std::string> folders;
    std::string_view file = path;
    for (size_t slash; (slash = file.find('/')) != std::string_view::npos; file.remove_prefix(slash + 1))
        folders.emplace_back(file.substr(0, slash));
    const size_t dot = file.find('.');
    const auto moment = moment_of(file.substr(0, dot));
    const std::string_view ending = dot == std::string_view::npos ? "" : file.substr(dot + 1);
    const bool is_ending = are_alphanumeric(ending) || ending == kNuscenesPoints;
    if (!moment || ending.size() > 16 || !is_ending || folders.empty() || folders.size() > 3 ||
        !std::ranges::all_of(folders, is_camera_name))
        return std::nullopt;
    ShardPicture picture{*moment, Path(path).parent_path().generic_string(), "", "", std::string(ending)};
    if (folders.size() > 1 && folders[0] == "buffers")
        folders.erase(folders.begin());
    if (folders[0] == "frames" || folders[0] == "latents") {
        picture.kind = folders[0].substr(0, folders[0].size() - 1);
        folders.erase(folders.begin());
    } else {
        picture.kind = folders.back();
        folders.pop_back();
        picture.group = Path(picture.group).parent_path().generic_string();
    }
    if (folders.size() > 1 || picture.kind.find('.') != std::string::npos) // else front.color would be front's color
        return std::nullopt;
    picture.camera = folders.empty() ? "" : folders[0];
    return picture;
}

bool is_key_prefix(std::string_view prefix)
{
    return prefix.size() <= 48 && std::ranges::all_of(prefix, [](char c) {
               return c == '_' || c == '-' || are_alphanumeric({&c, 1});
           });
}

std::string member_name(std::string_view key_prefix, const ShardPicture& p)
{
    return fmt::format("{}{:06}.{}{}{}.{}", key_prefix, p.moment, p.camera, p.camera.empty() ? "" : ".", p.kind,
                       p.ending);
}

Status write_shard_index(const Path& folder, const ShardIndex& index)
{
    std::string text = fmt::format("{{\"format\": \"{}\", \"version\": {}, \"key_prefix\": \"{}\", \"shards\": [",
                                   kShardFormat, kVersion, index.key_prefix);
    for (size_t i = 0; i < index.shards.size(); ++i) {
        const Shard& shard = index.shards[i];
        text += fmt::format("{}\n {{\"file\": \"{}\", \"bytes\": {}, \"members\": [", i ? "," : "", shard_name(i),
                            shard.bytes);
        append_rows(text, shard.members, true);
        text += "]}";
    }
    text += "],\n \"files\": [";
    append_rows(text, index.files, false);
    text += "]}\n";
    return write_file_atomically(folder / kShardIndexName, text);
}

Result<ShardIndex> read_shard_index(const Path& folder)
{
    const Path path = folder / kShardIndexName;
    const std::string file = quote_path(path);
    SR_TRY(const Json json, read_json(path, kIndexLimits));
    SR_CHECK(check_object(json, {"format", "version", "key_prefix", "shards", "files"}, file));
    if (json["format"] != kShardFormat || json["version"] != kVersion)
        return wrong(file, "expected a {} of version {}", kShardFormat, kVersion);
    const Json& prefix = json["key_prefix"];
    if (!prefix.is_string() || !is_key_prefix(prefix.get_ref<const std::string&>()))
        return wrong(file, "key_prefix is {}, expected letters, digits, '_' and '-'", quote(json_text(prefix), 60));
    ShardIndex index{prefix.get<std::string>(), {}, {}};
    const Json& shards = json["shards"];
    SR_CHECK(check_array(shards, "shards", file));
    if (shards.empty() || shards.size() > kMostShards)
        return wrong(file, "expected 1 to {} shards, found {}", kMostShards, shards.size());
    size_t files = 0;
    for (size_t i = 0; i < shards.size(); ++i) {
        SR_TRY(index.shards.emplace_back(), read_shard(shards[i], i, index.key_prefix, file));
        files += index.shards.back().members.size();
    }
    SR_CHECK(check_order(index, file));
    SR_CHECK(read_files(json["files"], index, file));
    if (files + index.files.size() > kMostShardFiles)
        return wrong(file, "expected at most {} files, found {}", kMostShardFiles, files + index.files.size());
    return index;
}

} // namespace semrover
