// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/gltf_document.h"

#include "runtime/base/json_fields.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace semrover {

namespace {

constexpr uint64_t kMaxJsonBytes = 64u << 20;
constexpr uint64_t kMaxNumber = uint64_t(1) << 40;
constexpr size_t kMaxInstances = 65536, kMaxDepth = 64;

struct Component {
    uint32_t code;
    uint32_t bytes;
    double largest; // of an integer, for normalized ones
};
constexpr Component kComponents[] = {{5120, 1, 127}, {5121, 1, 255}, {5122, 2, 32767}, {5123, 2, 65535}, {5126, 4, 0}};

uint32_t u32_at(std::span<const std::byte> bytes, size_t at)
{
    uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, 4);
    return value;
}

// an unsigned number of an object, or `missing`; none when it is something else
std::optional<uint64_t> number(const Json& object, const char* key, uint64_t missing)
{
    const auto entry = object.find(key);
    if (entry == object.end())
        return missing;
    if (!entry->is_number_unsigned() || entry->get<uint64_t>() > kMaxNumber)
        return std::nullopt;
    return entry->get<uint64_t>();
}

template <typename T>
double component_at(const std::byte* bytes)
{
    T value;
    std::memcpy(&value, bytes, sizeof(T));
    return static_cast<double>(value);
}

double component_at(uint32_t code, const std::byte* bytes)
{
    switch (code) {
    case 5120:
        return component_at<int8_t>(bytes);
    case 5121:
        return component_at<uint8_t>(bytes);
    case 5122:
        return component_at<int16_t>(bytes);
    case 5123:
        return component_at<uint16_t>(bytes);
    default:
        return component_at<float>(bytes);
    }
}

// `size` numbers of an array; none when it is something else
template <size_t N>
std::optional<std::array<double, N>> numbers(const Json& node, const char* key, const std::array<double, N>& missing)
{
    const auto entry = node.find(key);
    if (entry == node.end())
        return missing;
    std::array<double, N> out{};
    if (!entry->is_array() || entry->size() != N)
        return std::nullopt;
    for (size_t i = 0; i < N; ++i) {
        if (!(*entry)[i].is_number())
            return std::nullopt;
        out[i] = (*entry)[i].get<double>();
    }
    return out;
}

std::optional<std::array<double, 16>> local_transform(const Json& node)
{
    if (node.contains("matrix")) {
        const auto columns = numbers<16>(node, "matrix", {});
        if (!columns)
            return std::nullopt;
        std::array<double, 16> m;
        for (size_t row = 0; row < 4; ++row)
            for (size_t col = 0; col < 4; ++col)
                m[4 * row + col] = (*columns)[4 * col + row];
        return m;
    }
    const auto t = numbers<3>(node, "translation", {0, 0, 0});
    const auto r = numbers<4>(node, "rotation", {0, 0, 0, 1});
    const auto s = numbers<3>(node, "scale", {1, 1, 1});
    if (!t || !r || !s)
        return std::nullopt;
    const auto rigid = rigid_from_quaternion(*t, *r, "");
    if (!rigid)
        return std::nullopt;
    std::array<double, 16> m = *rigid;
    for (size_t row = 0; row < 3; ++row)
        for (size_t col = 0; col < 3; ++col)
            m[4 * row + col] *= (*s)[col];
    return m;
}

} // namespace

const Json* extension_of(const Json& object, const char* name)
{
    const auto all = object.find("extensions");
    if (all == object.end() || !all->is_object())
        return nullptr;
    const auto found = all->find(name);
    return found != all->end() && found->is_object() ? &*found : nullptr;
}

Result<GltfDocument> GltfDocument::open(const Path& path)
{
    GltfDocument d;
    d.where_ = quote_path(path);
    SR_TRY(d.file_, MappedFile::open(path));
    const auto bytes = d.file_.bytes();
    const auto refuse = [&](std::string_view text) { return fail(ErrorCode::bad_input, "{}: {}", d.where_, text); };
    if (bytes.size() < 20 || std::memcmp(bytes.data(), "glTF", 4) != 0)
        return refuse("no binary glTF file");
    if (u32_at(bytes, 4) != 2)
        return refuse(fmt::format("glTF version {}, expected 2", u32_at(bytes, 4)));
    if (u32_at(bytes, 8) != bytes.size())
        return refuse(fmt::format("its header says {} bytes, found {}", u32_at(bytes, 8), bytes.size()));
    const uint64_t json_bytes = u32_at(bytes, 12);
    if (std::memcmp(bytes.data() + 16, "JSON", 4) != 0)
        return refuse("its first chunk is not JSON");
    if (json_bytes > bytes.size() - 20 || json_bytes > kMaxJsonBytes)
        return refuse(fmt::format("a JSON chunk of {} bytes", json_bytes));
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()) + 20, json_bytes);
    SR_TRY(d.json_, parse_json(text, d.where_, {.bytes = kMaxJsonBytes}));
    if (!d.json_.is_object())
        return refuse("its JSON is no object");
    const uint64_t at = 20 + json_bytes;
    if (at + 8 <= bytes.size() && std::memcmp(bytes.data() + at + 4, "BIN\0", 4) == 0) {
        if (u32_at(bytes, at) > bytes.size() - at - 8)
            return refuse(
                fmt::format("a BIN chunk of {} bytes, {} are left", u32_at(bytes, at), bytes.size() - at - 8));
        d.binary_ = bytes.subspan(at + 8, u32_at(bytes, at));
    }
    return d;
}

const Json* GltfDocument::entry(const char* list, const Json& index) const
{
    const auto found = json_.find(list);
    if (found == json_.end() || !found->is_array() || !index.is_number_unsigned() ||
        index.get<uint64_t>() >= found->size() || !(*found)[index.get<size_t>()].is_object())
        return nullptr;
    return &(*found)[index.get<size_t>()];
}

Status GltfDocument::walk(const Json& index, const std::array<double, 16>& parent, size_t depth, size_t& visits,
                          std::vector<GltfInstance>& out) const
{
    const Json* node = entry("nodes", index);
    if (!node)
        return fail(ErrorCode::bad_input, "{}: there is no node {}", where_, printable(json_text(index, -1, true), 60));
    const auto local = local_transform(*node);
    if (!local)
        return fail(ErrorCode::bad_input, "{}: node {}: no transform", where_, index.get<uint64_t>());
    if (depth > kMaxDepth || ++visits > kMaxInstances)
        return fail(ErrorCode::bad_input, "{}: nodes more than {} deep, or more than {}", where_, kMaxDepth,
                    kMaxInstances);
    std::array<double, 16> m{};
    for (size_t row = 0; row < 4; ++row)
        for (size_t col = 0; col < 4; ++col)
            for (size_t k = 0; k < 4; ++k)
                m[4 * row + col] += parent[4 * row + k] * (*local)[4 * k + col];
    const Json* visibility = extension_of(*node, "KHR_node_visibility");
    if (visibility && visibility->value("visible", Json(true)) == false)
        return {};
    if (const auto mesh = node->find("mesh"); mesh != node->end()) {
        if (!entry("meshes", *mesh))
            return fail(ErrorCode::bad_input, "{}: node {}: there is no mesh {}", where_, index.get<uint64_t>(),
                        printable(mesh->dump(-1, ' ', true), 60));
        out.push_back({mesh->get<uint64_t>(), m, extension_of(*node, "EXT_mesh_gpu_instancing") != nullptr});
    }
    if (const auto children = node->find("children"); children != node->end()) {
        SR_CHECK(check_array(*children, "children", where_));
        for (const Json& child : *children)
            SR_CHECK(walk(child, m, depth + 1, visits, out));
    }
    return {};
}

Result<std::vector<GltfInstance>> GltfDocument::instances() const
{
    const Json first = uint64_t(0);
    const auto chosen = json_.find("scene");
    const Json* scene = entry("scenes", chosen == json_.end() ? first : *chosen);
    std::vector<GltfInstance> out;
    size_t visits = 0;
    if (scene && scene->contains("nodes")) {
        SR_CHECK(check_array((*scene)["nodes"], "nodes", where_));
        for (const Json& node : (*scene)["nodes"])
            SR_CHECK(walk(node, kIdentity, 0, visits, out));
        return out;
    }
    // without a scene, meshes where they are
    const auto meshes = json_.find("meshes");
    if (meshes != json_.end())
        SR_CHECK(check_array(*meshes, "meshes", where_));
    for (uint64_t i = 0; meshes != json_.end() && i < std::min(meshes->size(), kMaxInstances); ++i)
        out.push_back({i, kIdentity, false});
    return out;
}

Result<std::span<const std::byte>> GltfDocument::view(const Json& accessor, uint64_t& stride,
                                                      std::string_view name) const
{
    const auto index = accessor.find("bufferView");
    const Json* v = index == accessor.end() ? nullptr : entry("bufferViews", *index);
    if (!v || accessor.contains("sparse"))
        return fail(ErrorCode::bad_input, "{}: {}: an accessor without a buffer view, or a sparse one", where_, name);
    const auto buffer = number(*v, "buffer", kMaxNumber), offset = number(*v, "byteOffset", 0);
    const auto length = number(*v, "byteLength", kMaxNumber), step = number(*v, "byteStride", 0);
    if (!buffer || *buffer != 0 || !offset || !length || !step)
        return fail(ErrorCode::bad_input, "{}: {}: a buffer view outside the file's own buffer", where_, name);
    if (*offset > binary_.size() || *length > binary_.size() - *offset)
        return fail(ErrorCode::bad_input, "{}: {}: bytes {} to {} of a buffer of {}", where_, name, *offset,
                    *offset + *length, binary_.size());
    stride = *step;
    return binary_.subspan(*offset, *length);
}

Result<GltfDocument::Values> GltfDocument::read(const Json& index, std::initializer_list<std::string_view> types,
                                                std::string_view name) const
{
    const Json* accessor = entry("accessors", index);
    if (!accessor)
        return fail(ErrorCode::bad_input, "{}: {}: there is no such accessor", where_, name);
    uint64_t stride = 0;
    SR_TRY(const auto bytes, view(*accessor, stride, name));
    const auto type = accessor->find("type");
    if (type == accessor->end() || !type->is_string() ||
        std::ranges::find(types, type->get<std::string>()) == types.end())
        return fail(ErrorCode::bad_input, "{}: {}: expected the type {}", where_, name, fmt::join(types, " or "));
    Values out;
    const std::string text = type->get<std::string>();
    out.components = text == "SCALAR" ? 1 : static_cast<size_t>(text.back() - '0');
    const auto code = number(*accessor, "componentType", 0), count = number(*accessor, "count", 0);
    const auto offset = number(*accessor, "byteOffset", 0);
    const auto component = std::ranges::find(kComponents, code.value_or(0), &Component::code);
    if (component == std::end(kComponents) || !count || *count == 0 || !offset)
        return fail(ErrorCode::bad_input, "{}: {}: expected floats, bytes or shorts, and at least one", where_, name);
    const uint64_t element = component->bytes * out.components;
    if (stride == 0)
        stride = element;
    if (stride < element || stride > 252 || *offset > bytes.size() || bytes.size() - *offset < element ||
        (bytes.size() - *offset - element) / stride < *count - 1)
        return fail(ErrorCode::bad_input, "{}: {}: {} elements of {} bytes, {} apart, do not fit {} bytes from {}",
                    where_, name, *count, element, stride, bytes.size(), *offset);
    const auto flag = accessor->find("normalized");
    const bool normalized = flag != accessor->end() && *flag == true && component->largest > 0;
    out.data.reserve(*count * out.components);
    for (uint64_t i = 0; i < *count; ++i)
        for (size_t c = 0; c < out.components; ++c) {
            const double value =
                component_at(component->code, bytes.data() + *offset + i * stride + c * component->bytes);
            out.data.push_back(static_cast<float>(normalized ? std::max(value / component->largest, -1.0) : value));
        }
    return out;
}

} // namespace semrover
