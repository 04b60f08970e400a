// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/labels.h"

#include "engine/format/label_map.h"
#include "engine/mesh/texture_atlas.h"
#include "runtime/base/quote.h"
#include "runtime/base/star_pattern.h"

#include <algorithm>
#include <functional>
#include <map>
#include <set>

namespace semrover {

namespace {

char folded(char c)
{
    if (c == '_' || c == '-')
        return ' ';
    return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c;
}

bool is_letter(char c)
{
    return c >= 'a' && c <= 'z';
}

// does `name` start with `prefix`, and does a word end there?
bool starts_with_word(std::string_view name, std::string_view prefix)
{
    if (name.size() < prefix.size())
        return false;
    for (size_t i = 0; i < prefix.size(); ++i)
        if (folded(name[i]) != folded(prefix[i]))
            return false;
    return name.size() == prefix.size() || !is_letter(folded(name[prefix.size()]));
}

std::string folded_text(std::string_view text)
{
    std::string out;
    for (const char c : text)
        out += folded(c);
    return out;
}

// '*' stands for any text
bool matches(std::string_view pattern, std::string_view text)
{
    return matches_stars(pattern, text, [](std::string_view& rest, char c) {
        const bool same = rest[0] == c;
        rest.remove_prefix(1);
        return same;
    });
}

// The numbers of a label texture become classes, as the map says, or kNoLabel; colours of classes stay what they are.
void map_numbers(Texture& texture, const MeshLabelMap& map)
{
    std::map<uint16_t, std::optional<uint8_t>> known;
    const auto class_of = [&](uint16_t number) {
        const auto [at, fresh] = known.try_emplace(number);
        if (fresh)
            at->second = map.find(int64_t(number));
        return at->second;
    };
    for (uint16_t& number : texture.numbers)
        number = class_of(number).value_or(kNoLabel);
    if (!texture.numbers.empty())
        return;
    for (size_t i = 0; i < texture.image.pixels.size(); i += 3) {
        const uint8_t* rgb = &texture.image.pixels[i];
        const bool gray = rgb[0] == rgb[1] && rgb[1] == rgb[2];
        const std::optional<uint8_t> mapped = gray ? class_of(rgb[0]) : std::nullopt;
        const bool number = gray && rgb[0] < kClassCount;
        texture.numbers.push_back(mapped ? *mapped : number ? kNoLabel : label_of_pixel(rgb));
    }
}

} // namespace

std::optional<uint8_t> class_of_material(std::string_view name)
{
    std::optional<uint8_t> found;
    for (uint8_t i = 0; i < kClassCount; ++i)
        if (starts_with_word(name, kPalette[i].name) &&
            (!found || kPalette[i].name.size() > kPalette[*found].name.size()))
            found = i;
    return found;
}

Result<MeshLabelMap> MeshLabelMap::read(const Path& name_or_file)
{
    SR_TRY(const LabelTable table, read_label_table(name_or_file));
    MeshLabelMap map;
    map.whole_ = table.whole;
    for (const LabelTable::Label& label : table.labels) {
        const uint8_t target = label.target < kClassCount ? label.target : kNoLabel;
        if (label.number)
            map.entries_.push_back({std::to_string(*label.number), target});
        if (!label.name.empty())
            map.entries_.push_back({folded_text(label.name), target});
    }
    // an object's keys come sorted; exact names first
    std::ranges::stable_partition(map.entries_,
                                  [](const Entry& e) { return e.pattern.find('*') == std::string::npos; });
    return map;
}

std::optional<uint8_t> MeshLabelMap::find(std::string_view name) const
{
    const std::string text = folded_text(name);
    for (const Entry& e : entries_)
        if (matches(e.pattern, text))
            return e.label;
    return std::nullopt;
}

std::optional<uint8_t> MeshLabelMap::find(int64_t number, bool foreign) const
{
    if (!entries_.empty())
        if (const auto label = find(std::string_view(std::to_string(number))))
            return label;
    if (!whole_ && !foreign && number >= 0 && number < int64_t(kClassCount))
        return uint8_t(number);
    return number == kNoLabel || number == -1 ? std::optional(kNoLabel) : std::nullopt;
}

std::vector<UnlabelledFaces> label_faces(Mesh& mesh, LabelSource source, const MeshLabelMap& map)
{
    std::vector<uint8_t> by_material(mesh.materials.size(), kNoLabel);
    for (size_t i = 0; i < by_material.size(); ++i) {
        Material& m = mesh.materials[i];
        if (source == LabelSource::texture && m.label_texture < 0)
            m.label_texture = m.texture;
        if (source == LabelSource::automatic || source == LabelSource::material) {
            const auto mapped = map.find(m.name);
            by_material[i] = mapped ? *mapped : class_of_material(m.name).value_or(kNoLabel);
        }
    }
    std::set<int32_t> label_textures;
    for (const Material& m : mesh.materials)
        if (m.label_texture >= 0 && !map.empty() && label_textures.insert(m.label_texture).second)
            map_numbers(mesh.textures[size_t(m.label_texture)], map);
    const bool own = source == LabelSource::automatic || source == LabelSource::face;
    const bool textures = (source == LabelSource::automatic || source == LabelSource::texture) && !mesh.uvs.empty();
    std::vector<uint8_t> labels(mesh.faces.size(), kNoLabel);
    std::map<std::string, UnlabelledFaces> without;
    for (size_t f = 0; f < labels.size(); ++f) {
        if (own && !mesh.face_labels.empty())
            labels[f] = mesh.face_labels[f];
        const Material* m = mesh.face_materials.empty() ? nullptr : &mesh.materials[mesh.face_materials[f]];
        if (labels[f] == kNoLabel && m)
            labels[f] = by_material[mesh.face_materials[f]];
        if (labels[f] != kNoLabel || (textures && m && m->label_texture >= 0))
            continue;
        const std::string name = m && source != LabelSource::face ? m->name : "";
        UnlabelledFaces& entry = without[name];
        entry.name = name;
        ++entry.faces;
        entry.area += face_area(mesh, f);
    }
    if (!textures)
        for (Material& m : mesh.materials)
            m.label_texture = -1;
    mesh.face_labels = std::move(labels);
    std::vector<UnlabelledFaces> list;
    for (auto& [name, entry] : without)
        list.push_back(std::move(entry));
    std::ranges::stable_sort(list, std::greater(), &UnlabelledFaces::area);
    return list;
}

std::string unlabelled_text(std::span<const UnlabelledFaces> list)
{
    std::string text;
    for (const UnlabelledFaces& e : list.first(std::min<size_t>(list.size(), 10)))
        text += fmt::format("{}{} ({} faces, {:.4g} m^2)", text.empty() ? "" : ", ",
                            e.name.empty() ? "faces without a named material" : quote(e.name, 60), e.faces, e.area);
    if (list.size() > 10)
        text += fmt::format(" and {} more", list.size() - 10);
    return text;
}

} // namespace semrover
