// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/texture_atlas.h"

#include "engine/mesh/transparency.h"
#include "engine/scene/palette.h"

#include <algorithm>
#include <bit>

namespace semrover {

namespace {

constexpr uint32_t kNone = 0xffffffff;

uint64_t texels_of(const Texture& t)
{
    return uint64_t(t.image.width) * t.image.height;
}

} // namespace

uint8_t label_of_number(uint16_t number)
{
    return number < kClassCount ? uint8_t(number) : kNoLabel;
}

uint8_t label_of_pixel(const uint8_t* rgb)
{
    for (uint8_t i = 0; i < kClassCount; ++i)
        if (std::equal(rgb, rgb + 3, kPalette[i].color.begin()))
            return i;
    return rgb[0] == rgb[1] && rgb[1] == rgb[2] ? label_of_number(rgb[0]) : kNoLabel;
}

Result<TextureAtlas> TextureAtlas::create(Device& device, const Mesh& mesh, uint8_t default_label)
{
    TextureAtlas atlas;
    Rows table;
    std::vector<int32_t>& label_sources = table.labels;
    for (const Material& m : mesh.materials)
        if (m.label_texture >= 0 && std::ranges::find(label_sources, m.label_texture) == label_sources.end())
            label_sources.push_back(m.label_texture);
    atlas.has_labels_ = !label_sources.empty();
    std::vector<std::array<uint32_t, 4>>& rows = table.rows;
    uint64_t texels = 0;
    const auto add = [&](const Texture& t) {
        rows.push_back({t.image.width, t.image.height, uint32_t(texels), uint32_t(t.wrap_u) | uint32_t(t.wrap_v) << 2});
        texels += texels_of(t);
    };
    for (const Texture& t : mesh.textures)
        add(t);
    for (const int32_t source : label_sources)
        add(mesh.textures[size_t(source)]);
    if (texels >= kNone)
        return fail(ErrorCode::bad_input, "the textures have {} pixels, at most 2^32 are supported", texels);
    SR_CHECK(atlas.add_alphas(device, mesh, table));
    SR_CHECK(atlas.upload_tables(device, mesh, table));
    SR_CHECK(atlas.upload_texels(device, mesh, label_sources, default_label, texels));
    return atlas;
}

// textures of materials that alpha cuts out
Status TextureAtlas::add_alphas(Device& device, const Mesh& mesh, Rows& table)
{
    masked_ = has_transparency(mesh);
    uint64_t texels = 0;
    for (const Material& m : mesh.materials) {
        const bool used = m.alpha_cutoff > 0 && m.alpha_texture >= 0 && !mesh.uvs.empty();
        if (!used || std::ranges::find(table.alphas, m.alpha_texture) != table.alphas.end())
            continue;
        const Texture& t = mesh.textures[size_t(m.alpha_texture)];
        if (t.alpha.empty())
            continue;
        if (texels + t.alpha.size() > std::min(device.limits().max_storage_range, device.limits().max_allocation))
            return fail(ErrorCode::out_of_memory, "textures with alpha have more than {} pixels, the device binds {}",
                        texels + t.alpha.size(),
                        std::min(device.limits().max_storage_range, device.limits().max_allocation));
        table.alphas.push_back(m.alpha_texture);
        table.rows.push_back(
            {t.image.width, t.image.height, uint32_t(texels), uint32_t(t.wrap_u) | uint32_t(t.wrap_v) << 2});
        table.alpha_words.resize((texels + t.alpha.size() + 3) / 4);
        for (const uint8_t alpha : t.alpha) {
            table.alpha_words[texels / 4] |= uint32_t(alpha) << (8 * (texels % 4));
            ++texels;
        }
    }
    if (table.alpha_words.empty())
        table.alpha_words.push_back(0); // a binding is never empty
    return {};
}

Status TextureAtlas::upload_tables(Device& device, const Mesh& mesh, const Rows& table)
{
    const std::vector<int32_t>& label_sources = table.labels;
    std::vector<std::array<uint32_t, 8>> materials;
    const bool has_uvs = !mesh.uvs.empty();
    for (const Material& m : mesh.materials) {
        std::array<uint32_t, 8> row = {0, 0, 0, kNone, kNone, kNone};
        row[6] = std::bit_cast<uint32_t>(alpha_threshold(m));
        if (const auto at = std::ranges::find(table.alphas, m.alpha_texture);
            m.alpha_cutoff > 0 && at != table.alphas.end()) {
            row[5] = uint32_t(mesh.textures.size() + table.labels.size() + size_t(at - table.alphas.begin()));
            row[7] = m.alpha_texture == m.texture;
        }
        for (size_t a = 0; a < 3; ++a)
            row[a] = std::bit_cast<uint32_t>(m.color[a]);
        if (m.texture >= 0 && has_uvs)
            row[3] = uint32_t(m.texture);
        if (m.label_texture >= 0 && has_uvs)
            row[4] = uint32_t(mesh.textures.size()) +
                     uint32_t(std::ranges::find(label_sources, m.label_texture) - label_sources.begin());
        materials.push_back(row);
    }
    if (materials.empty()) { // what faces without one have
        const uint32_t one = std::bit_cast<uint32_t>(1.f);
        materials.push_back({one, one, one, kNone, kNone, kNone});
    }
    auto rows = table.rows;
    if (rows.empty())
        rows.push_back({1, 1, 0, 0}); // a binding is never empty
    materials_ = tables_.tensor(uint32_t(materials.size()), 8, DType::u32, "materials", 8);
    textures_ = tables_.tensor(uint32_t(rows.size()), 4, DType::u32, "textures", 4);
    alphas_ = tables_.tensor(uint32_t(table.alpha_words.size()), 1, DType::u32, "alphas", 1);
    SR_CHECK(tables_.allocate(device, "materials"));
    SR_CHECK(alphas_.write(device, table.alpha_words));
    SR_CHECK(materials_.write(device, materials));
    return textures_.write(device, rows);
}

Status TextureAtlas::upload_texels(Device& device, const Mesh& mesh, const std::vector<int32_t>& label_sources,
                                   uint8_t default_label, uint64_t texels)
{
    const DeviceLimits& limits = device.limits();
    const uint64_t page_texels = std::min(limits.max_storage_range, limits.max_allocation) / 4;
    const uint32_t unknown = default_label == kNoLabel ? kNoSurfaceLabel : default_label;
    std::vector<uint32_t> page;
    uint64_t written = 0;
    const auto flush = [&]() -> Status {
        Page& p = pages_.emplace_back();
        p.first = uint32_t(written);
        p.texels = p.state.tensor(uint32_t(page.size()), 1, DType::u32, "texels", 1);
        SR_CHECK(p.state.allocate(device, "texels"));
        SR_CHECK(p.texels.write(device, page));
        written += page.size();
        page.clear();
        return {};
    };
    const auto add = [&](const Texture& texture, bool labels) -> Status {
        for (size_t i = 0; i < texture.image.pixels.size(); i += 3) {
            const uint8_t* p = &texture.image.pixels[i];
            uint8_t label = kNoLabel;
            if (labels)
                label = texture.numbers.empty() ? label_of_pixel(p) : label_of_number(texture.numbers[i / 3]);
            page.push_back(labels ? (label == kNoLabel ? unknown : label)
                                  : uint32_t(p[0]) | uint32_t(p[1]) << 8 | uint32_t(p[2]) << 16);
            if (page.size() == page_texels)
                SR_CHECK(flush());
        }
        return {};
    };
    page.reserve(std::min(texels, page_texels));
    for (const Texture& t : mesh.textures)
        SR_CHECK(add(t, false));
    for (const int32_t source : label_sources)
        SR_CHECK(add(mesh.textures[size_t(source)], true));
    return page.empty() ? Status{} : flush();
}

Tensor TextureAtlas::materials(Graph& g) const
{
    return materials_.in(g);
}

Tensor TextureAtlas::textures(Graph& g) const
{
    return textures_.in(g);
}

Tensor TextureAtlas::alphas(Graph& g) const
{
    return alphas_.in(g);
}

void TextureAtlas::gather(Graph& g, Tensor addresses, Tensor y, Tensor count) const
{
    for (const Page& page : pages_)
        gather_texels(g, addresses, page.texels.in(g), page.first, y, count);
}

} // namespace semrover
