// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// Wavefront MTL: colours, textures and how much shows through. Source: "MTL material format (Lightwave, OBJ)",
// http://paulbourke.net/dataformats/mtl/
#include "engine/mesh/obj_materials.h"

#include "engine/scene/srgb.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr uint64_t kMaxMtlBytes = 16u << 20;
constexpr size_t kMaxMaterials = 1 << 16, kMaxLibraries = 4096, kMaxNameWords = 32;
constexpr float kHalf = 0.5f;

bool is_number(std::string_view word)
{
    return !word.empty() && word.find_first_not_of("+-.0123456789eE") == std::string_view::npos;
}

// words between blanks; a blank behind a backslash belongs to its word
std::vector<std::string> split_names(std::string_view text)
{
    std::vector<std::string> words(1);
    for (size_t i = 0; i < text.size(); ++i) {
        const bool escaped = text[i] == '\\' && i + 1 < text.size() && text[i + 1] == ' ';
        if (escaped)
            words.back() += text[++i];
        else if (text[i] != ' ' && text[i] != '\t')
            words.back() += text[i];
        else if (!words.back().empty())
            words.emplace_back();
    }
    return words;
}

// how many values an option takes at most; others are not known
std::optional<size_t> values_of(std::string_view option)
{
    if (option == "-s" || option == "-o" || option == "-t")
        return 3;
    if (option == "-mm")
        return 2;
    for (const std::string_view one :
         {"-blendu", "-blendv", "-boost", "-bm", "-cc", "-clamp", "-colorspace", "-imfchan", "-texres", "-type"})
        if (option == one)
            return 1;
    return std::nullopt;
}

} // namespace

Result<uint32_t> ObjMaterials::add(const std::string& name)
{
    const auto [entry, is_new] = numbers_.try_emplace(name, uint32_t(mesh_.materials.size()));
    if (is_new && mesh_.materials.size() >= kMaxMaterials)
        return fail(ErrorCode::bad_input, "{}: more than {} materials", obj_, kMaxMaterials);
    if (is_new) {
        mesh_.materials.push_back({.name = name});
        seen_.emplace_back();
    }
    return entry->second;
}

// the longest names that are files, from the left; all of it as one where nothing is
std::vector<std::string> ObjMaterials::library_names(std::string_view text)
{
    const std::vector<std::string> words = split_names(text);
    if (folder_.has(text) || words.size() == 1 || words.size() > kMaxNameWords)
        return {words.size() == 1 && !folder_.has(text) ? words[0] : std::string(text)};
    std::vector<std::string> names;
    bool any = false;
    for (size_t first = 0; first < words.size();) {
        size_t last = words.size();
        std::string name;
        for (; last > first; --last) {
            name = fmt::format("{}", fmt::join(words.begin() + ptrdiff_t(first), words.begin() + ptrdiff_t(last), " "));
            if (folder_.has(name))
                break;
        }
        any = any || last > first;
        names.push_back(last > first ? name : words[first]);
        first = std::max(last, first + 1);
    }
    return any ? names : std::vector<std::string>{std::string(text)};
}

Status ObjMaterials::read_libraries(std::string_view names, size_t line)
{
    const std::string where = fmt::format("{}: line {}", obj_, line);
    if (names.empty())
        return fail(ErrorCode::bad_input, "{}: mtllib without a name", where);
    if (++libraries_ > kMaxLibraries)
        return fail(ErrorCode::bad_input, "{}: more than {} lines of mtllib", where, kMaxLibraries);
    for (const std::string& name : library_names(names))
        SR_CHECK(read_library(name, where));
    for (std::string& warning : folder_.warnings)
        add_warning(mesh_.warnings, std::move(warning));
    folder_.warnings.clear();
    return {};
}

Status ObjMaterials::read_library(std::string_view name, std::string_view where)
{
    if (folder_.missing(name)) { // names of materials are in the OBJ itself; colours and textures are not
        add_warning(mesh_.warnings, fmt::format("{}: {} is missing: its materials are white", where, quote(name)));
        return {};
    }
    SR_TRY(const Path path, folder_.find(name, where));
    if (!files_.insert(path).second)
        return {};
    const std::string file = quote_path(path);
    SR_TRY(const std::string text, read_text_file(path, kMaxMtlBytes));
    WordLines lines(text);
    int64_t current = -1;
    while (lines.next())
        if (!lines.words.empty())
            SR_CHECK(read_line(lines, fmt::format("{}: line {}", file, lines.number), current));
    settle_alpha(file);
    for (Material& m : mesh_.materials)
        if (m.texture >= 0 && m.color == std::array<float, 3>{0, 0, 0})
            m.color = {1, 1, 1}; // exporters leave Kd black beside a texture
    return {};
}

Status ObjMaterials::read_line(const WordLines& lines, const std::string& where, int64_t& current)
{
    std::string key(lines.words[0]);
    std::ranges::transform(key, key.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? char(c + 32) : c; });
    if (key == "newmtl") {
        SR_TRY(current, add(std::string(lines.rest(1))));
        seen_[size_t(current)] = {};
        seen_[size_t(current)].in_file = true;
        return {};
    }
    if (key != "kd" && key != "map_kd" && key != "d" && key != "tr" && key != "map_d")
        return {};
    if (current < 0)
        return fail(ErrorCode::bad_input, "{}: {} in front of the first newmtl", where, lines.words[0]);
    const auto material = size_t(current);
    if (key == "kd")
        return read_color(lines, where, mesh_.materials[material]);
    if (key == "map_kd" || key == "map_d")
        return read_map(key == "map_d" ? Map::alpha : Map::color, lines, where, material);
    if (lines.words.size() < 2)
        return fail(ErrorCode::bad_input, "{}: {} without a number", where, lines.words[0]);
    SR_TRY(const double value, number_of(lines.words.back(), where)); // d -halo 0.5
    if (!(value >= 0 && value <= 1))
        return fail(ErrorCode::bad_input, "{}: {} {}, expected 0 to 1", where, lines.words[0], value);
    (key == "d" ? seen_[material].dissolve : seen_[material].transparency) = value;
    return {};
}

Status ObjMaterials::read_color(const WordLines& lines, const std::string& where, Material& material)
{
    if (lines.words.size() != 2 && lines.words.size() != 4)
        return fail(ErrorCode::bad_input, "{}: Kd with {} numbers, expected 3", where, lines.words.size() - 1);
    for (size_t a = 0; a < 3; ++a) { // as programs write it: what a picture shows, that is sRGB
        SR_TRY(const double number, number_of(lines.words[std::min(a + 1, lines.words.size() - 1)], where));
        const auto value = float(number);
        if (!(value >= 0 && value <= 1))
            return fail(ErrorCode::bad_input, "{}: the colour {}, expected 0 to 1", where, value);
        material.color[a] = float(linear_of_srgb(value));
    }
    return {};
}

// returns the word behind its values; the last word is the file's
Result<size_t> ObjMaterials::read_option(const WordLines& lines, size_t at, const std::string& where,
                                         MapOptions& options)
{
    const std::string_view option = lines.words[at];
    const auto most = values_of(option);
    std::vector<std::string_view> values;
    const bool is_word = option == "-imfchan" || option == "-type" || option == "-colorspace";
    for (++at; at + 1 < lines.words.size() && values.size() < most.value_or(3); ++at) {
        const std::string_view word = lines.words[at];
        if (!is_word && !is_number(word) && word != "on" && word != "off")
            break;
        values.push_back(word);
    }
    const auto ignored = [&] {
        add_warning(mesh_.warnings, fmt::format("{}: the option {} {} is ignored", where, printable(option, 40),
                                                printable(fmt::format("{}", fmt::join(values, " ")), 60)));
    };
    if (option == "-s" || option == "-o")
        for (size_t i = 0; i < std::min<size_t>(values.size(), 2); ++i) {
            SR_TRY((option == "-s" ? options.mapping.scale : options.mapping.offset)[i], number_of(values[i], where));
        }
    else if (option == "-clamp" && !values.empty())
        options.wrap = values[0] == "on" ? TextureWrap::clamp : TextureWrap::repeat;
    else if (option == "-imfchan" && !values.empty())
        options.channel = values[0].front();
    else if (!most || option == "-cc" || (option == "-type" && values != std::vector<std::string_view>{"sphere"}))
        ignored();
    else if (option == "-colorspace" && !values.empty() && values[0] != "sRGB" && values[0] != "auto")
        ignored();
    else if (option == "-mm" || option == "-t") { // which change nothing where they are 0 1, and 0 0 0
        const std::string_view none[] = {"0", option == "-mm" ? "1" : "0", "0"};
        for (size_t i = 0; i < values.size(); ++i) {
            SR_TRY(const double value, number_of(values[i], where));
            if (value != number_of(none[i], where).value_or(0))
                ignored();
        }
    }
    return at;
}

Result<size_t> ObjMaterials::read_options(const WordLines& lines, const std::string& where, MapOptions& options)
{
    size_t at = 1;
    while (at + 1 < lines.words.size() && lines.words[at].starts_with('-')) {
        SR_TRY(at, read_option(lines, at, where, options));
    }
    return at;
}

// map_Kd or map_d [-option values]... file
Status ObjMaterials::read_map(Map map, const WordLines& lines, const std::string& where, size_t index)
{
    MapOptions options;
    SR_TRY(const size_t at, read_options(lines, where, options));
    const std::string name(lines.rest(at));
    SR_TRY(const int32_t texture, folder_.texture(mesh_, name, where, options.wrap));
    Seen& seen = seen_[index];
    Material& material = mesh_.materials[index];
    (map == Map::color ? material.texture : material.alpha_texture) = texture;
    (map == Map::color ? seen.color : seen.alpha) = options.mapping;
    (map == Map::color ? seen.color_name : seen.alpha_name) = name;
    if (map == Map::alpha && texture >= 0)
        return take_alpha(size_t(texture), options.channel, name == seen.color_name, where);
    return {};
}

// Alpha of a picture that has some, or its brightness where it is a mask. Exporters write map_d for the picture of
// map_Kd (`alone`), whose brightness means nothing
Status ObjMaterials::take_alpha(size_t index, char channel, bool alone, std::string_view where)
{
    Texture& t = mesh_.textures[index];
    if (channel == 0)
        channel = alone || !t.alpha.empty() ? 'm' : 'l';
    const auto [entry, is_new] = channels_.try_emplace(index, channel);
    if (entry->second != channel)
        return fail(ErrorCode::bad_input, "{}: map_d takes alpha of the channels {} and {} of the same picture", where,
                    printable(std::string_view(&entry->second, 1), 4), printable(std::string_view(&channel, 1), 4));
    if (!is_new || channel == 'm')
        return {};
    t.alpha.resize(t.image.pixels.size() / 3);
    for (size_t i = 0; i < t.alpha.size(); ++i) {
        const uint8_t* p = &t.image.pixels[3 * i];
        t.alpha[i] = channel == 'r'   ? p[0]
                     : channel == 'g' ? p[1]
                     : channel == 'b' ? p[2]
                                      : uint8_t((299u * p[0] + 587u * p[1] + 114u * p[2] + 500) / 1000);
    }
    return {};
}

// Tr is 1 - d. Some exporters write d into it: then it would be 1, which nothing shows of, where a material is opaque.
// So Tr means d in a file whose materials all have it, none below one half and some of 1.
void ObjMaterials::settle_alpha(std::string_view where)
{
    bool swapped = false, all = true;
    for (const Seen& s : seen_)
        if (s.in_file) {
            all = all && !s.dissolve && s.transparency && *s.transparency > 0.5;
            swapped = swapped || s.transparency == 1.0;
        }
    swapped = swapped && all;
    if (swapped)
        add_warning(mesh_.warnings, fmt::format("{}: all materials have a Tr of more than 0.5, which is taken for d: "
                                                "they are opaque",
                                                where));
    for (size_t i = 0; i < seen_.size(); ++i) {
        Seen& s = seen_[i];
        Material& m = mesh_.materials[i];
        if (!s.in_file)
            continue;
        s.in_file = false;
        m.alpha = float(s.dissolve ? *s.dissolve : swapped ? *s.transparency : 1 - s.transparency.value_or(0));
        m.alpha_cutoff = m.alpha_texture >= 0 || m.alpha < 1 ? kHalf : 0;
        if (s.alpha && s.color && *s.alpha != *s.color)
            add_warning(mesh_.warnings, fmt::format("{}: material {}: map_d lies where map_Kd does, its own -s and -o "
                                                    "are ignored",
                                                    where, quote(m.name, 60)));
        const Texture* t = m.texture >= 0 ? &mesh_.textures[size_t(m.texture)] : nullptr;
        if (!s.alpha && t && !t->alpha.empty() && std::ranges::min(t->alpha) < 128)
            add_warning(mesh_.warnings, fmt::format("{}: material {}: alpha of map_Kd is ignored; map_d {} would use "
                                                    "it",
                                                    where, quote(m.name, 60), printable(s.color_name, 60)));
    }
}

void ObjMaterials::place_textures()
{
    if (mesh_.uvs.empty() || mesh_.face_materials.empty())
        return;
    std::vector<Mapping> mappings;
    for (const Seen& s : seen_)
        mappings.push_back(s.color.value_or(s.alpha.value_or(Mapping{})));
    for (size_t f = 0; f < mesh_.faces.size(); ++f) {
        const Mapping& m = mappings[mesh_.face_materials[f]];
        if (m == Mapping{})
            continue;
        for (auto& uv : mesh_.uvs[f]) { // v runs up in the file
            const double up = 1 - double(uv[1]);
            uv = {float(m.scale[0] * uv[0] + m.offset[0]), float(1 - (m.scale[1] * up + m.offset[1]))};
        }
    }
}

} // namespace semrover
