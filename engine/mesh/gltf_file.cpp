// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/gltf_file.h"

#include "runtime/base/json_fields.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"
#include "runtime/base/text_start.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace semrover {

static_assert(std::endian::native == std::endian::little, "numbers lie in the file as in memory");

namespace {

constexpr JsonLimits kJsonLimits{.bytes = 512u << 20, .depth = 64, .values = 32u << 20, .containers = 1u << 20};

uint32_t component_bytes(int64_t component)
{
    switch (component) {
    case 5120:
    case 5121:
        return 1;
    case 5122:
    case 5123:
        return 2;
    case 5125:
    case 5126:
        return 4;
    default:
        return 0;
    }
}

uint32_t components_of(const Json& type)
{
    constexpr const char* kTypes[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
    for (uint32_t i = 0; i < 4; ++i)
        if (type == kTypes[i])
            return i + 1;
    return type == "MAT4" ? 16 : 0;
}

template <typename T>
T read_as(const std::byte* at)
{
    T value;
    std::memcpy(&value, at, sizeof(T));
    return value;
}

template <typename T>
double read_integer(const std::byte* at, bool normalized)
{
    const double value = read_as<T>(at);
    return normalized ? std::max(value / double(std::numeric_limits<T>::max()), -1.0) : value;
}

// false for what is not base64
bool decode_base64(std::string_view text, std::vector<std::byte>& out)
{
    uint32_t bits = 0, have = 0;
    out.reserve(text.size() / 4 * 3);
    while (text.ends_with('='))
        text.remove_suffix(1);
    for (const char c : text) {
        constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        const size_t digit = kDigits.find(c);
        if (digit == std::string_view::npos)
            return false;
        bits = bits << 6 | uint32_t(digit);
        have += 6;
        if (have >= 8) {
            have -= 8;
            out.push_back(std::byte(bits >> have & 0xff));
        }
    }
    return true;
}

// %20 and the like
std::string percent_decoded(std::string_view uri)
{
    const auto digit = [](char c) {
        return c >= '0' && c <= '9'   ? c - '0'
               : c >= 'a' && c <= 'f' ? c - 'a' + 10
               : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                      : -1;
    };
    std::string out;
    for (size_t i = 0; i < uri.size(); ++i)
        if (uri[i] == '%' && i + 2 < uri.size() && digit(uri[i + 1]) >= 0 && digit(uri[i + 2]) >= 0) {
            out += char(digit(uri[i + 1]) * 16 + digit(uri[i + 2]));
            i += 2;
        } else {
            out += uri[i];
        }
    return out;
}

} // namespace

double GltfAccessor::number(size_t element, uint32_t c) const
{
    const std::byte* at = data + element * stride + c * component_bytes(component);
    switch (component) {
    case 5120:
        return read_integer<int8_t>(at, normalized);
    case 5121:
        return read_integer<uint8_t>(at, normalized);
    case 5122:
        return read_integer<int16_t>(at, normalized);
    case 5123:
        return read_integer<uint16_t>(at, normalized);
    case 5125:
        return read_as<uint32_t>(at);
    default:
        return read_as<float>(at);
    }
}

uint32_t GltfAccessor::index(size_t element) const
{
    const std::byte* at = data + element * stride;
    return component == 5121 ? read_as<uint8_t>(at) : component == 5123 ? read_as<uint16_t>(at) : read_as<uint32_t>(at);
}

GltfFile::GltfFile(const Path& path, MissingTextures missing_textures)
    : where_(quote_path(path)), folder_(path, missing_textures)
{
}

Result<GltfFile> GltfFile::open(const Path& path, MissingTextures missing_textures)
{
    GltfFile f(path, missing_textures);
    SR_TRY(f.file_, MappedFile::open(path));
    std::string_view text(reinterpret_cast<const char*>(f.file_.bytes().data()), f.file_.bytes().size());
    if (text.starts_with("glTF")) {
        SR_CHECK(f.split_binary(text));
    } else {
        SR_TRY(text, text_after_mark(text, f.where_));
    }
    SR_TRY(f.json_, parse_json(text, f.where_, kJsonLimits));
    if (!f.json_.is_object())
        return fail(ErrorCode::bad_input, "{}: expected glTF, found {}", f.where_, f.json_.type_name());
    SR_CHECK(f.check_version());
    SR_CHECK(f.load_buffers());
    return f;
}

// header of 12 bytes; chunks of length, type and data: JSON, then perhaps BIN
Status GltfFile::split_binary(std::string_view& text)
{
    const std::span<const std::byte> file = file_.bytes();
    const auto word = [&](size_t at) { return read_as<uint32_t>(file.data() + at); };
    if (file.size() < 20 || word(4) != 2)
        return fail(ErrorCode::bad_input, "{}: expected binary glTF of version 2, found {}", where_,
                    file.size() < 20 ? "a cut file" : fmt::format("version {}", word(4)));
    const uint64_t json_bytes = word(12);
    if (word(8) > file.size() || json_bytes > file.size() - 20 || word(16) != 0x4E4F534A)
        return fail(ErrorCode::bad_input,
                    "{}: says it has {} bytes with {} of JSON, the file has {}; it is cut or broken", where_, word(8),
                    json_bytes, file.size());
    text = text.substr(20, json_bytes);
    const size_t at = 20 + json_bytes;
    if (file.size() - at < 8 || word(at + 4) != 0x004E4942)
        return {};
    if (word(at) > file.size() - at - 8)
        return fail(ErrorCode::bad_input, "{}: says it has {} bytes of data, {} are left; the file is cut", where_,
                    word(at), file.size() - at - 8);
    binary_ = file.subspan(at + 8, word(at));
    return {};
}

Status GltfFile::check_version() const
{
    const auto asset = json_.find("asset");
    const bool has = asset != json_.end() && asset->is_object() && asset->contains("version");
    if (!has || !(*asset)["version"].is_string() || !(*asset)["version"].get<std::string>().starts_with("2."))
        return fail(ErrorCode::bad_input, "{}: expected glTF of version 2", where_);
    SR_TRY(const size_t required, count("extensionsRequired"));
    for (size_t i = 0; i < required; ++i) {
        const Json& name = json_["extensionsRequired"][i];
        constexpr const char* kKnown[] = {"KHR_texture_transform", "KHR_mesh_quantization",   "KHR_lights_punctual",
                                          "KHR_node_visibility",   "EXT_mesh_gpu_instancing", "MSFT_lod"};
        const bool material = name.is_string() && name.get_ref<const std::string&>().starts_with("KHR_materials_");
        if (!material && std::ranges::find(kKnown, name) == std::end(kKnown))
            return fail(ErrorCode::bad_input, "{}: needs the extension {}, which is not supported", where_,
                        quote(name.is_string() ? name.get<std::string>() : "?", 60));
    }
    return {};
}

Result<size_t> GltfFile::count(const char* array) const
{
    const auto found = json_.find(array);
    if (found == json_.end())
        return 0;
    SR_CHECK(check_array(*found, array, where_));
    return found->size();
}

Result<const Json*> GltfFile::entry(const char* array, int64_t index) const
{
    SR_TRY(const size_t size, count(array));
    if (index < 0 || index >= int64_t(size))
        return fail(ErrorCode::bad_input, "{}: refers to {}[{}], there are {}", where_, array, index, size);
    const Json& found = json_[array][size_t(index)];
    if (!found.is_object())
        return fail(ErrorCode::bad_input, "{}: {}[{}]: expected an object, found {}", where_, array, index,
                    found.type_name());
    return &found;
}

Result<std::optional<int64_t>> GltfFile::integer(const Json& object, const char* key) const
{
    const auto found = object.find(key);
    if (found == object.end())
        return std::optional<int64_t>();
    if (!found->is_number_integer() || (found->is_number_unsigned() && found->get<uint64_t>() > uint64_t(1) << 53))
        return fail(ErrorCode::bad_input, "{}: {}: expected a whole number, found {}", where_, key,
                    printable(found->dump(-1, ' ', true), 40));
    return std::optional(found->get<int64_t>());
}

Result<std::vector<double>> GltfFile::numbers(const Json& object, const char* key, size_t count,
                                              std::string_view where) const
{
    const auto found = object.find(key);
    if (found == object.end())
        return std::vector<double>();
    SR_TRY(std::vector<double> values, numbers_of(*found, fmt::format("{}: {}", where, key)));
    if (values.size() != count)
        return fail(ErrorCode::bad_input, "{}: {}: expected {} numbers, found {}", where, key, count, values.size());
    return values;
}

Result<std::span<const std::byte>> GltfFile::load_uri(const std::string& uri, std::string_view where)
{
    if (!uri.starts_with("data:")) {
        SR_TRY(const Path path, folder_.find(percent_decoded(uri), where));
        auto named = named_.find(path);
        if (named == named_.end()) {
            SR_TRY(MappedFile file, MappedFile::open(path));
            named = named_.emplace(path, std::move(file)).first;
        }
        return named->second.bytes();
    }
    constexpr std::string_view kBase64 = ";base64,";
    const size_t comma = uri.substr(0, 200).find(kBase64);
    std::vector<std::byte> bytes;
    if (comma == std::string::npos || !decode_base64(std::string_view(uri).substr(comma + kBase64.size()), bytes))
        return fail(ErrorCode::bad_input, "{}: a data URI that is not base64", where);
    data_uris_.push_back(std::move(bytes));
    return data_uris_.back();
}

uint64_t GltfFile::bytes() const
{
    uint64_t sum = file_.bytes().size();
    for (const auto& [path, file] : named_)
        sum += file.bytes().size();
    return sum;
}

Status GltfFile::load_buffers()
{
    SR_TRY(const size_t buffers, count("buffers"));
    for (size_t i = 0; i < buffers; ++i) {
        SR_TRY(const Json* buffer, entry("buffers", int64_t(i)));
        SR_TRY(const auto length, integer(*buffer, "byteLength"));
        const auto uri = buffer->find("uri");
        const std::string where = fmt::format("{}: buffers[{}]", where_, i);
        std::span<const std::byte> bytes = binary_;
        if (uri != buffer->end() && uri->is_string()) {
            SR_TRY(bytes, load_uri(uri->get_ref<const std::string&>(), where));
        } else if (i > 0 || binary_.empty()) {
            return fail(ErrorCode::bad_input, "{}: has neither a uri nor the file's binary part", where);
        }
        if (!length || *length < 0 || uint64_t(*length) > bytes.size())
            return fail(ErrorCode::bad_input, "{}: says it has {} bytes, {} are there", where, length.value_or(-1),
                        bytes.size());
        buffers_.push_back(bytes.first(size_t(*length)));
    }
    return {};
}

Result<std::span<const std::byte>> GltfFile::view(int64_t index) const
{
    SR_TRY(const Json* view, entry("bufferViews", index));
    SR_TRY(const auto buffer, integer(*view, "buffer"));
    SR_TRY(const auto offset, integer(*view, "byteOffset"));
    SR_TRY(const auto length, integer(*view, "byteLength"));
    if (!buffer || *buffer < 0 || *buffer >= int64_t(buffers_.size()))
        return fail(ErrorCode::bad_input, "{}: bufferViews[{}]: refers to buffer {}, there are {}", where_, index,
                    buffer.value_or(-1), buffers_.size());
    const std::span<const std::byte> bytes = buffers_[size_t(*buffer)];
    const int64_t begin = offset.value_or(0), size = length.value_or(-1);
    if (begin < 0 || size < 0 || uint64_t(begin) > bytes.size() || uint64_t(size) > bytes.size() - uint64_t(begin))
        return fail(ErrorCode::bad_input, "{}: bufferViews[{}]: {} bytes from {} on, the buffer has {}", where_, index,
                    size, begin, bytes.size());
    return bytes.subspan(size_t(begin), size_t(size));
}

Result<GltfAccessor> GltfFile::accessor(int64_t index) const
{
    SR_TRY(const Json* json, entry("accessors", index));
    const std::string where = fmt::format("{}: accessors[{}]", where_, index);
    SR_TRY(const auto view_index, integer(*json, "bufferView"));
    SR_TRY(const auto offset, integer(*json, "byteOffset"));
    SR_TRY(const auto component, integer(*json, "componentType"));
    SR_TRY(const auto count, integer(*json, "count"));
    if (json->contains("sparse"))
        return fail(ErrorCode::bad_input, "{}: is sparse, which is not supported", where);
    if (!view_index)
        return fail(ErrorCode::bad_input, "{}: has no bufferView (compressed meshes are not supported)", where);
    GltfAccessor a;
    a.component = int(component.value_or(0));
    a.components = json->contains("type") ? components_of((*json)["type"]) : 0;
    const uint64_t bytes = component_bytes(component.value_or(0)) * uint64_t(a.components);
    if (!bytes)
        return fail(ErrorCode::bad_input, "{}: a type or componentType that is not supported", where);
    const auto normalized = json->find("normalized");
    a.normalized = normalized != json->end() && *normalized == true;
    SR_TRY(const auto data, view(*view_index));
    SR_TRY(const Json* view_json, entry("bufferViews", *view_index));
    SR_TRY(const auto stride, integer(*view_json, "byteStride"));
    const int64_t step = stride.value_or(int64_t(bytes)), begin = offset.value_or(0), n = count.value_or(-1);
    const bool fits = step >= int64_t(bytes) && step <= 1024 && begin >= 0 && n >= 1 && n <= int64_t(1) << 40 &&
                      uint64_t(begin) <= data.size() &&
                      uint64_t(n - 1) * uint64_t(step) + bytes <= data.size() - uint64_t(begin);
    if (!fits)
        return fail(ErrorCode::bad_input, "{}: {} elements of {} bytes, {} apart, from {} on, in a bufferView of {}",
                    where, n, bytes, step, begin, data.size());
    a.data = data.data() + begin;
    a.count = size_t(n);
    a.stride = size_t(step);
    return a;
}

Result<std::span<const std::byte>> GltfFile::image_file(int64_t index)
{
    SR_TRY(const Json* json, entry("images", index));
    const std::string where = fmt::format("{}: images[{}]", where_, index);
    SR_TRY(const auto view_index, integer(*json, "bufferView"));
    if (view_index)
        return view(*view_index);
    const auto uri = json->find("uri");
    if (uri == json->end() || !uri->is_string())
        return fail(ErrorCode::bad_input, "{}: has neither a bufferView nor a uri", where);
    return load_uri(uri->get_ref<const std::string&>(), where);
}

} // namespace semrover
