// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/vox_file.h"

#include "runtime/base/quote.h"

#include <charconv>
#include <cstring>

namespace semrover {

namespace {

constexpr size_t kMaxNodes = 1u << 20;
constexpr int64_t kMaxTranslation = 1 << 20;

// bytes of one chunk
class Cursor {
  public:
    Cursor(std::span<const std::byte> bytes, size_t base, std::string where)
        : bytes_(bytes), base_(base), where_(std::move(where))
    {
    }

    size_t left() const { return bytes_.size() - at_; }
    size_t position() const { return base_ + at_; } // in the file

    template <typename... Args>
    tl::unexpected<Error> refuse(fmt::format_string<Args...> format, Args&&... args) const
    {
        return fail(ErrorCode::bad_input, "{} at byte {}: {}", where_, position(),
                    fmt::format(format, std::forward<Args>(args)...));
    }

    Result<std::span<const std::byte>> take(uint64_t size)
    {
        if (size > left())
            return refuse("{} bytes are expected, {} are left", size, left());
        const auto part = bytes_.subspan(at_, size);
        at_ += size;
        return part;
    }

    Result<uint32_t> u32()
    {
        SR_TRY(const auto raw, take(4));
        uint32_t value = 0;
        std::memcpy(&value, raw.data(), 4);
        return value;
    }

    Result<std::string> text()
    {
        SR_TRY(const uint32_t size, u32());
        SR_TRY(const auto raw, take(size));
        return std::string(reinterpret_cast<const char*>(raw.data()), raw.size());
    }

    Result<std::map<std::string, std::string>> dictionary()
    {
        std::map<std::string, std::string> pairs;
        SR_TRY(const uint32_t count, u32());
        for (uint32_t i = 0; i < count; ++i) { // each takes 8 bytes at least, so that this ends
            SR_TRY(std::string key, text());
            SR_TRY(pairs[std::move(key)], text());
        }
        return pairs;
    }

  private:
    std::span<const std::byte> bytes_;
    size_t base_, at_ = 0;
    std::string where_;
};

std::optional<int64_t> integer(std::string_view text)
{
    int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size())
        return std::nullopt;
    return value;
}

// three integers and blanks
std::optional<std::array<int64_t, 3>> translation_of(std::string_view text)
{
    std::array<int64_t, 3> t{};
    for (size_t a = 0; a < 3; ++a) {
        const size_t begin = text.find_first_not_of(' ');
        if (begin == std::string_view::npos)
            return std::nullopt;
        text.remove_prefix(begin);
        const size_t end = std::min(text.find(' '), text.size());
        const auto value = integer(text.substr(0, end));
        if (!value || *value < -kMaxTranslation || *value > kMaxTranslation)
            return std::nullopt;
        t[a] = *value;
        text.remove_prefix(end);
    }
    if (text.find_first_not_of(' ') != std::string_view::npos)
        return std::nullopt;
    return t;
}

// bits 0-1, 2-3: column of the entry of the first and second row; 4, 5, 6: rows that are negative
std::optional<std::array<int8_t, 9>> rotation_of(std::string_view text)
{
    const auto bits = integer(text);
    if (!bits || *bits < 0 || *bits > 127)
        return std::nullopt;
    const size_t first = *bits & 3, second = (*bits >> 2) & 3;
    if (first > 2 || second > 2 || first == second)
        return std::nullopt;
    std::array<int8_t, 9> r{};
    const size_t columns[3] = {first, second, 3 - first - second};
    for (size_t row = 0; row < 3; ++row)
        r[3 * row + columns[row]] = (*bits >> (4 + row)) & 1 ? -1 : 1;
    return r;
}

class Parser {
  public:
    Parser(std::span<const std::byte> bytes, std::string_view where) : bytes_(bytes), where_(where) {}

    Result<VoxFile> parse();

  private:
    Status chunks(Cursor& main);
    Status chunk(std::string_view id, Cursor& c);
    Status size(Cursor& c);
    Status voxels(Cursor& c);
    Status palette(Cursor& c);
    Status transform(Cursor& c);
    Status group(Cursor& c);
    Status shape(Cursor& c);
    Status layer(Cursor& c);
    Result<VoxNode*> add_node(Cursor& c, VoxNode::Kind kind);
    Cursor cursor(std::string_view id, std::span<const std::byte> bytes, size_t base) const
    {
        return {bytes, base, fmt::format("{}: chunk {}", where_, quote(id, 8))};
    }

    std::span<const std::byte> bytes_;
    std::string_view where_;
    VoxFile file_;
    bool has_palette_ = false, has_size_ = false;
};

Status Parser::size(Cursor& c)
{
    if (has_size_)
        return c.refuse("a second SIZE before the first one's XYZI");
    VoxModel model;
    for (uint32_t& side : model.size) {
        SR_TRY(side, c.u32());
        if (side < 1 || side > 256)
            return c.refuse("expected a size of 1 to 256, found {}", side);
    }
    file_.models.push_back(std::move(model));
    has_size_ = true;
    return {};
}

Status Parser::voxels(Cursor& c)
{
    if (!has_size_)
        return c.refuse("XYZI without a SIZE before it");
    has_size_ = false;
    VoxModel& model = file_.models.back();
    SR_TRY(const uint32_t count, c.u32());
    SR_TRY(const auto raw, c.take(uint64_t(count) * 4));
    model.voxels.resize(count);
    if (count)
        std::memcpy(model.voxels.data(), raw.data(), raw.size());
    for (const VoxVoxel& v : model.voxels)
        if (v.x >= model.size[0] || v.y >= model.size[1] || v.z >= model.size[2] || v.color == 0)
            return c.refuse("voxel ({}, {}, {}) of colour {} in a model of {} x {} x {}", v.x, v.y, v.z, v.color,
                            model.size[0], model.size[1], model.size[2]);
    return {};
}

Status Parser::palette(Cursor& c)
{
    SR_TRY(const auto raw, c.take(1024));
    for (size_t i = 0; i < 255; ++i) // the file's colour i is index i + 1
        for (size_t a = 0; a < 3; ++a)
            file_.palette[i + 1][a] = std::to_integer<uint8_t>(raw[4 * i + a]);
    has_palette_ = true;
    return {};
}

Result<VoxNode*> Parser::add_node(Cursor& c, VoxNode::Kind kind)
{
    SR_TRY(const uint32_t id, c.u32());
    SR_TRY(const auto attributes, c.dictionary());
    if (file_.nodes.size() == kMaxNodes)
        return c.refuse("more than {} nodes", kMaxNodes);
    VoxNode& node = file_.nodes[id];
    if (node.kind != VoxNode::Kind::none)
        return c.refuse("a second node {}", id);
    node.kind = kind;
    const auto hidden = attributes.find("_hidden");
    node.hidden = hidden != attributes.end() && hidden->second == "1";
    return &node;
}

Status Parser::transform(Cursor& c)
{
    SR_TRY(VoxNode * node, add_node(c, VoxNode::Kind::transform));
    SR_TRY(const uint32_t child, c.u32());
    node->children.push_back(child);
    SR_CHECK(c.u32()); // reserved
    SR_TRY(const uint32_t layer, c.u32());
    node->layer = static_cast<int32_t>(layer);
    SR_TRY(const uint32_t frames, c.u32());
    if (frames == 0)
        return {};
    SR_TRY(const auto frame, c.dictionary()); // the first of an animation
    if (const auto r = frame.find("_r"); r != frame.end()) {
        const auto rotation = rotation_of(r->second);
        if (!rotation)
            return c.refuse("_r {} is no rotation", quote(r->second, 40));
        node->transform.rotation = *rotation;
    }
    if (const auto t = frame.find("_t"); t != frame.end()) {
        const auto translation = translation_of(t->second);
        if (!translation)
            return c.refuse("_t {} is no translation", quote(t->second, 40));
        node->transform.translation = *translation;
    }
    return {};
}

Status Parser::group(Cursor& c)
{
    SR_TRY(VoxNode * node, add_node(c, VoxNode::Kind::group));
    SR_TRY(const uint32_t count, c.u32());
    for (uint32_t i = 0; i < count; ++i) {
        SR_TRY(const uint32_t child, c.u32());
        node->children.push_back(child);
    }
    return {};
}

Status Parser::shape(Cursor& c)
{
    SR_TRY(VoxNode * node, add_node(c, VoxNode::Kind::shape));
    SR_TRY(const uint32_t count, c.u32());
    for (uint32_t i = 0; i < count; ++i) {
        SR_TRY(const uint32_t model, c.u32());
        SR_CHECK(c.dictionary());
        node->children.push_back(model);
    }
    return {};
}

Status Parser::layer(Cursor& c)
{
    SR_TRY(const uint32_t id, c.u32());
    SR_TRY(const auto attributes, c.dictionary());
    const auto hidden = attributes.find("_hidden");
    file_.hidden_layers[static_cast<int32_t>(id)] = hidden != attributes.end() && hidden->second == "1";
    return {};
}

Status Parser::chunk(std::string_view id, Cursor& c)
{
    if (id == "SIZE")
        return size(c);
    if (id == "XYZI")
        return voxels(c);
    if (id == "RGBA")
        return palette(c);
    if (id == "nTRN")
        return transform(c);
    if (id == "nGRP")
        return group(c);
    if (id == "nSHP")
        return shape(c);
    if (id == "LAYR")
        return layer(c);
    return {}; // materials, cameras, notes, ...
}

Status Parser::chunks(Cursor& main)
{
    while (main.left()) {
        SR_TRY(const auto name, main.take(4));
        const std::string_view id(reinterpret_cast<const char*>(name.data()), 4);
        SR_TRY(const uint32_t content, main.u32());
        SR_TRY(const uint32_t children, main.u32());
        const size_t base = main.position();
        SR_TRY(const auto bytes, main.take(content));
        SR_CHECK(main.take(children));
        Cursor c = cursor(id, bytes, base);
        SR_CHECK(chunk(id, c));
    }
    return {};
}

Result<VoxFile> Parser::parse()
{
    Cursor head = cursor("VOX ", bytes_, 0);
    SR_TRY(const auto magic, head.take(4));
    if (std::memcmp(magic.data(), "VOX ", 4) != 0)
        return fail(ErrorCode::bad_input, "{}: no MagicaVoxel file: it starts with {}", where_,
                    quote({reinterpret_cast<const char*>(magic.data()), 4}));
    SR_TRY(const uint32_t version, head.u32());
    if (version < 150 || version > 200)
        return head.refuse("version {}, expected 150 to 200", version);
    SR_TRY(const auto name, head.take(4));
    if (std::memcmp(name.data(), "MAIN", 4) != 0)
        return head.refuse("expected the chunk MAIN, found {}", quote({reinterpret_cast<const char*>(name.data()), 4}));
    SR_TRY(const uint32_t content, head.u32());
    SR_TRY(const uint32_t children, head.u32());
    SR_CHECK(head.take(content));
    const size_t base = head.position();
    SR_TRY(const auto bytes, head.take(children));
    Cursor main = cursor("MAIN", bytes, base);
    SR_CHECK(chunks(main));
    if (has_size_)
        return fail(ErrorCode::bad_input, "{}: a SIZE without its XYZI", where_);
    if (file_.models.empty())
        return fail(ErrorCode::bad_input, "{}: has no models", where_);
    if (!has_palette_)
        file_.palette = default_vox_palette();
    return std::move(file_);
}

// ---- writing

class VoxWriter {
  public:
    void u32(uint64_t value) { put(static_cast<uint32_t>(value)); }
    void text(std::string_view text)
    {
        u32(text.size());
        raw(text);
    }
    void raw(std::string_view text)
    {
        const auto* first = reinterpret_cast<const std::byte*>(text.data());
        bytes.insert(bytes.end(), first, first + text.size());
    }
    void chunk(std::string_view id, const VoxWriter& content)
    {
        raw(id);
        u32(content.bytes.size());
        u32(0);
        bytes.insert(bytes.end(), content.bytes.begin(), content.bytes.end());
    }

    std::vector<std::byte> bytes;

  private:
    void put(uint32_t value)
    {
        for (int i = 0; i < 4; ++i)
            bytes.push_back(std::byte((value >> (8 * i)) & 255));
    }
};

VoxWriter transform_node(size_t id, size_t child, const std::string& translation)
{
    VoxWriter b;
    b.u32(id);
    b.u32(0); // attributes
    b.u32(child);
    b.u32(~0u);                           // reserved
    b.u32(translation.empty() ? ~0u : 0); // layer; the root has none
    b.u32(1);                             // frames
    b.u32(translation.empty() ? 0 : 1);
    if (!translation.empty()) {
        b.text("_t");
        b.text(translation);
    }
    return b;
}

void append_model(VoxWriter& main, const VoxModel& model)
{
    VoxWriter size, voxels;
    for (const uint32_t side : model.size)
        size.u32(side);
    voxels.u32(model.voxels.size());
    voxels.raw({reinterpret_cast<const char*>(model.voxels.data()), model.voxels.size() * sizeof(VoxVoxel)});
    main.chunk("SIZE", size);
    main.chunk("XYZI", voxels);
}

} // namespace

// red, green and blue of six levels each but for black, blue fastest; then ten levels more of red, green, blue and gray
std::array<std::array<uint8_t, 3>, 256> default_vox_palette()
{
    std::array<std::array<uint8_t, 3>, 256> palette{};
    constexpr uint8_t kRamp[] = {0xee, 0xdd, 0xbb, 0xaa, 0x88, 0x77, 0x55, 0x44, 0x22, 0x11};
    const auto level = [](size_t digit) { return uint8_t(255 - 51 * digit); };
    for (size_t i = 0; i < 215; ++i)
        palette[i + 1] = {level(i / 36), level(i / 6 % 6), level(i % 6)};
    for (size_t i = 0; i < 40; ++i)
        for (size_t a = 0; a < 3; ++a)
            palette[216 + i][a] = i / 10 == a || i / 10 == 3 ? kRamp[i % 10] : uint8_t(0);
    return palette;
}

VoxTransform compose(const VoxTransform& a, const VoxTransform& b)
{
    VoxTransform c;
    for (size_t row = 0; row < 3; ++row) {
        c.translation[row] = a.translation[row];
        for (size_t k = 0; k < 3; ++k)
            c.translation[row] += a.rotation[3 * row + k] * b.translation[k];
        for (size_t col = 0; col < 3; ++col) {
            int sum = 0;
            for (size_t k = 0; k < 3; ++k)
                sum += a.rotation[3 * row + k] * b.rotation[3 * k + col];
            c.rotation[3 * row + col] = static_cast<int8_t>(sum);
        }
    }
    return c;
}

Cell vox_cell(const VoxTransform& transform, const VoxModel& model, const VoxVoxel& voxel)
{
    const uint8_t at[3] = {voxel.x, voxel.y, voxel.z};
    Cell cell;
    for (size_t row = 0; row < 3; ++row) {
        int64_t twice = 0; // of the voxel's centre from the pivot: odd
        for (size_t k = 0; k < 3; ++k)
            twice += transform.rotation[3 * row + k] * (2 * int64_t(at[k]) + 1 - 2 * int64_t(model.size[k] / 2));
        cell[row] = static_cast<int32_t>((twice - 1) / 2 + transform.translation[row]);
    }
    return cell;
}

Result<VoxFile> parse_vox(std::span<const std::byte> bytes, std::string_view where)
{
    return Parser(bytes, where).parse();
}

std::vector<std::byte> encode_vox(std::span<const VoxModel> models,
                                  std::span<const std::array<int64_t, 3>> translations,
                                  std::span<const std::array<uint8_t, 3>> palette)
{
    VoxWriter main, group, colors;
    for (const VoxModel& model : models)
        append_model(main, model);
    main.chunk("nTRN", transform_node(0, 1, ""));
    group.u32(1);
    group.u32(0);
    group.u32(models.size());
    for (size_t i = 0; i < models.size(); ++i)
        group.u32(2 + 2 * i);
    main.chunk("nGRP", group);
    for (size_t i = 0; i < models.size(); ++i) {
        const auto& t = translations[i];
        main.chunk("nTRN", transform_node(2 + 2 * i, 3 + 2 * i, fmt::format("{} {} {}", t[0], t[1], t[2])));
        VoxWriter shape;
        for (const uint64_t value : {uint64_t(3 + 2 * i), uint64_t(0), uint64_t(1), uint64_t(i), uint64_t(0)})
            shape.u32(value);
        main.chunk("nSHP", shape);
    }
    for (size_t i = 0; i < 256; ++i) {
        const std::array<uint8_t, 3> c = i < palette.size() ? palette[i] : std::array<uint8_t, 3>{};
        colors.u32(c[0] | c[1] << 8 | c[2] << 16 | 255u << 24);
    }
    main.chunk("RGBA", colors);
    VoxWriter file;
    file.raw("VOX ");
    file.u32(150);
    file.raw("MAIN");
    file.u32(0);
    file.u32(main.bytes.size());
    file.bytes.insert(file.bytes.end(), main.bytes.begin(), main.bytes.end());
    return std::move(file.bytes);
}

} // namespace semrover
