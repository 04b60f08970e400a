// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "runtime/base/safetensors.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr size_t kMaxShards = 10'000;
// an index entry is a name and a file name; 1 M of them at about 100 bytes
constexpr JsonLimits kIndexLimits = {.bytes = kMaxSafetensorsHeader, .depth = 8, .values = 2'000'000};

struct Index {
    std::map<std::string, uint32_t> shard_of;
    std::vector<std::string> shards; // file names, in the order of the first tensor by name
    std::optional<uint64_t> total_size;
};

bool is_pickle(const Path& path)
{
    static constexpr std::string_view kPickles[] = {".bin", ".pt", ".pth", ".ckpt", ".pkl"};
    return std::ranges::find(kPickles, path.extension().string()) != std::end(kPickles);
}

tl::unexpected<Error> refuse_pickle(const Path& path)
{
    return fail(ErrorCode::bad_input,
                "{}: a {} file can run code when it is read, so only safetensors are; convert it with Python: import "
                "torch, safetensors.torch as s; d = torch.load(FILE, map_location='cpu', weights_only=True); "
                "s.save_file({{k: v.contiguous().clone() for k, v in d.get('state_dict', d).items() if "
                "torch.is_tensor(v)}}, '{}.safetensors')",
                quote_path(path), path.extension().string(), printable(path.stem().string(), 100));
}

// [A-Za-z0-9._-]+\.safetensors, so that no shard lies outside the index's folder
bool is_shard_name(std::string_view name)
{
    static constexpr std::string_view kSuffix = ".safetensors";
    const auto allowed = [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' ||
               c == '-';
    };
    return name.size() > kSuffix.size() && name.ends_with(kSuffix) && std::ranges::all_of(name, allowed);
}

Result<Index> read_index(const Path& path)
{
    SR_TRY(const Json json, read_json(path, kIndexLimits));
    const std::string where = quote_path(path);
    const auto map = json.is_object() ? json.find("weight_map") : json.end();
    if (!json.is_object() || map == json.end() || !map->is_object() || map->empty())
        return fail(ErrorCode::bad_input, "{}: expected an object with a weight_map that names the file of each tensor",
                    where);
    Index index;
    std::map<std::string, uint32_t> number_of;
    for (const auto& [tensor, file] : map->items()) {
        if (!file.is_string() || !is_shard_name(file.get_ref<const std::string&>()))
            return fail(ErrorCode::bad_input,
                        "{}: tensor {}: expected a file name such as x-00001.safetensors, found {}", where,
                        quote(tensor), quote(json_text(file, -1, true), 100));
        const auto& name = file.get_ref<const std::string&>();
        const auto [entry, is_new] = number_of.try_emplace(name, static_cast<uint32_t>(index.shards.size()));
        if (is_new)
            index.shards.push_back(name);
        if (index.shards.size() > kMaxShards)
            return fail(ErrorCode::bad_input, "{}: more than {} shards", where, kMaxShards);
        index.shard_of.emplace(tensor, entry->second);
    }
    if (const auto metadata = json.find("metadata"); metadata != json.end() && metadata->is_object())
        if (const auto total = metadata->find("total_size"); total != metadata->end()) {
            if (!total->is_number_unsigned())
                return fail(ErrorCode::bad_input, "{}: expected total_size to be a whole number, found {}", where,
                            quote(total->dump(-1, ' ', true), 40));
            index.total_size = total->get<uint64_t>();
        }
    return index;
}

// the tensor of shard `number` is one that the index puts there
Status check_listed(const std::string& tensor, uint32_t number, const Index& index, std::string_view where)
{
    const auto listed = index.shard_of.find(tensor);
    if (listed == index.shard_of.end())
        return fail(ErrorCode::bad_input, "{}: tensor {} of shard {} is not in the index", where, quote(tensor),
                    quote(index.shards[number]));
    if (listed->second != number)
        return fail(ErrorCode::bad_input, "{}: tensor {} belongs in shard {}, but is in {} too", where, quote(tensor),
                    quote(index.shards[listed->second]), quote(index.shards[number]));
    return {};
}

} // namespace

Result<SafetensorsSet> SafetensorsSet::open(const Path& path, const SafetensorsLimits& limits)
{
    if (is_pickle(path))
        return refuse_pickle(path);
    if (path.extension() == ".json")
        return open_index(path, limits);
    SafetensorsSet set;
    set.path_ = path;
    SR_TRY(Safetensors file, Safetensors::open(path, limits));
    set.tensors_ = file.tensors();
    set.unsupported_ = file.unsupported();
    set.shards_.push_back(std::move(file));
    return set;
}

Result<SafetensorsSet> SafetensorsSet::open_index(const Path& path, const SafetensorsLimits& limits)
{
    const std::string where = quote_path(path);
    SR_TRY(const Index index, read_index(path));
    SafetensorsSet set;
    set.path_ = path;
    uint64_t total_size = 0;
    for (uint32_t number = 0; number < index.shards.size(); ++number) {
        SR_TRY(Safetensors file, Safetensors::open(path.parent_path() / index.shards[number], limits));
        for (TensorInfo tensor : file.tensors()) {
            SR_CHECK(check_listed(tensor.name, number, index, where));
            tensor.shard = number;
            total_size += tensor.bytes();
            set.tensors_.push_back(std::move(tensor));
        }
        for (const UnsupportedTensor& tensor : file.unsupported()) {
            SR_CHECK(check_listed(tensor.name, number, index, where));
            total_size += tensor.end - tensor.begin;
            set.unsupported_.push_back(tensor);
        }
        set.shards_.push_back(std::move(file));
    }
    std::ranges::sort(set.tensors_, {}, &TensorInfo::name);
    std::ranges::sort(set.unsupported_, {}, &UnsupportedTensor::name);
    if (set.tensors_.size() + set.unsupported_.size() != index.shard_of.size())
        for (const auto& [tensor, number] : index.shard_of)
            if (!set.find(tensor) &&
                !std::ranges::binary_search(set.unsupported_, tensor, {}, &UnsupportedTensor::name))
                return fail(ErrorCode::bad_input, "{}: tensor {} is not in shard {}", where, quote(tensor),
                            quote(index.shards[number]));
    if (index.total_size && *index.total_size != total_size)
        return fail(ErrorCode::bad_input, "{}: expected total_size {} bytes, found {} in the shards", where,
                    *index.total_size, total_size);
    return set;
}

Result<SafetensorsSet> SafetensorsSet::open_folder(const Path& folder, std::string_view base,
                                                   const SafetensorsLimits& limits)
{
    if (!is_folder(folder))
        return fail(ErrorCode::bad_input, "cannot read weights: {} is no folder", quote_path(folder));
    for (const char* suffix :
         {".fp16.safetensors", ".safetensors", ".safetensors.index.fp16.json", ".safetensors.index.json"}) {
        const Path path = folder / (std::string(base) + suffix);
        if (is_there(path))
            return open(path, limits);
    }
    for (const Path& file : list_files(folder).value_or(std::vector<Path>{}))
        if (is_pickle(file))
            return refuse_pickle(file);
    return fail(ErrorCode::bad_input,
                "{}: expected {}.safetensors, .fp16.safetensors or .safetensors.index.json, found none",
                quote_path(folder), base);
}

} // namespace semrover
