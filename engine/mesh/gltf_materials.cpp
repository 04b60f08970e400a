// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/gltf_materials.h"

#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

// an object in objects, by its keys; null when it is not there
const Json* find_object(const Json& object, std::initializer_list<const char*> keys)
{
    const Json* at = &object;
    for (const char* key : keys) {
        const auto found = at->find(key);
        if (found == at->end() || !found->is_object())
            return nullptr;
        at = &*found;
    }
    return at;
}

} // namespace

Result<TextureWrap> GltfMaterials::wrap_of(const Json& texture, const char* key) const
{
    SR_TRY(const auto index, file_.integer(texture, "sampler"));
    if (!index)
        return TextureWrap::repeat;
    SR_TRY(const Json* sampler, file_.entry("samplers", *index));
    SR_TRY(const auto wrap, file_.integer(*sampler, key));
    switch (wrap.value_or(10497)) {
    case 10497:
        return TextureWrap::repeat;
    case 33648:
        return TextureWrap::mirror;
    case 33071:
        return TextureWrap::clamp;
    default:
        return fail(ErrorCode::bad_input, "{}: samplers[{}]: {} is no wrap mode", where_, *index, *wrap);
    }
}

Result<int32_t> GltfMaterials::decoded(int64_t image, TextureWrap u, TextureWrap v)
{
    SR_TRY(const auto file, file_.image_file(image));
    const auto entry = textures_.find({file.data(), u, v});
    if (entry != textures_.end())
        return entry->second;
    const std::string where = fmt::format("{}: images[{}]", where_, image);
    SR_TRY(ImageWithAlpha pixels, decode_image_with_alpha(file, where, budget_.pixels_left(file.size())));
    budget_.take(pixels.color);
    SR_TRY(std::vector<uint16_t> numbers, texture_numbers(file, where));
    mesh_.textures.push_back({std::move(pixels.color), u, v, std::move(pixels.alpha), std::move(numbers)});
    return textures_[{file.data(), u, v}] = int32_t(mesh_.textures.size() - 1);
}

Result<int32_t> GltfMaterials::texture_of(int64_t index, const std::string& where)
{
    SR_TRY(const Json* texture, file_.entry("textures", index));
    SR_TRY(const auto source, file_.integer(*texture, "source"));
    if (!source)
        return fail(ErrorCode::bad_input, "{}: textures[{}] has no PNG or JPEG image", where, index);
    SR_TRY(const TextureWrap u, wrap_of(*texture, "wrapS"));
    SR_TRY(const TextureWrap v, wrap_of(*texture, "wrapT"));
    return decoded(*source, u, v);
}

Status GltfMaterials::read_transform(const Json& info, const std::string& where, GltfTextureView& view)
{
    const auto extensions = info.find("extensions");
    if (extensions == info.end() || !extensions->is_object() || !extensions->contains("KHR_texture_transform"))
        return {};
    const Json& transform = (*extensions)["KHR_texture_transform"];
    if (!transform.is_object())
        return fail(ErrorCode::bad_input, "{}: KHR_texture_transform: expected an object", where);
    SR_TRY(const auto offset, file_.numbers(transform, "offset", 2, where));
    SR_TRY(const auto scale, file_.numbers(transform, "scale", 2, where));
    SR_TRY(const auto rotation, optional_number(transform, "rotation", where));
    SR_TRY(const auto own_set, file_.integer(transform, "texCoord"));
    std::ranges::copy(offset, view.offset);
    std::ranges::copy(scale, view.scale);
    view.rotation = rotation.value_or(0);
    view.set = own_set.value_or(view.set);
    return {};
}

Status GltfMaterials::read_texture(const Json& info, const std::string& where, Material& material,
                                   GltfTextureView& view)
{
    SR_TRY(const auto index, file_.integer(info, "index"));
    SR_TRY(const auto set, file_.integer(info, "texCoord"));
    view.set = set.value_or(0);
    SR_TRY(material.texture, file_.folder().texture_or_white(texture_of(index.value_or(-1), where)));
    return read_transform(info, where, view);
}

Status GltfMaterials::read_base_color(const Json& pbr, const char* factor_key, const char* texture_key,
                                      const std::string& where, Material& material, GltfTextureView& view)
{
    SR_TRY(const auto factor, file_.numbers(pbr, factor_key, 4, where));
    if (!factor.empty()) {
        for (size_t a = 0; a < 3; ++a)
            material.color[a] = float(factor[a]);
        material.alpha = float(factor[3]);
    }
    const auto texture = pbr.find(texture_key);
    return texture != pbr.end() && texture->is_object() ? read_texture(*texture, where, material, view) : Status{};
}

// OPAQUE ignores alpha; what is blended is a surface from one half on
Status GltfMaterials::read_alpha(const Json& json, const std::string& where, Material& material)
{
    const auto given = json.find("alphaMode");
    const Json mode = given == json.end() ? Json("OPAQUE") : *given;
    SR_TRY(const auto cutoff, optional_number(json, "alphaCutoff", where));
    if (mode != "OPAQUE" && mode != "MASK" && mode != "BLEND")
        return fail(ErrorCode::bad_input, "{}: alphaMode: expected OPAQUE, MASK or BLEND, found {}", where,
                    printable(json_text(mode, -1, true), 40));
    material.alpha_cutoff = mode == "OPAQUE" ? 0 : mode == "MASK" ? float(std::max(cutoff.value_or(0.5), 0.0)) : 0.5f;
    const bool textured = material.texture >= 0 && !mesh_.textures[size_t(material.texture)].alpha.empty();
    if (material.alpha_cutoff > 0 && textured)
        material.alpha_texture = material.texture;
    return {};
}

Status GltfMaterials::read_material(const Json& json, const std::string& where)
{
    Material material;
    GltfTextureView view;
    if (const auto name = json.find("name"); name != json.end() && name->is_string())
        material.name = name->get<std::string>();
    if (const auto pbr = json.find("pbrMetallicRoughness"); pbr != json.end() && pbr->is_object())
        SR_CHECK(read_base_color(*pbr, "baseColorFactor", "baseColorTexture", where, material, view));
    // of exporters from before 2.0's end: its colour is the one to take where both are there
    if (const Json* older = find_object(json, {"extensions", "KHR_materials_pbrSpecularGlossiness"}))
        SR_CHECK(read_base_color(*older, "diffuseFactor", "diffuseTexture", where, material, view));
    SR_CHECK(read_alpha(json, where, material));
    if (const auto extras = json.find("extras"); extras != json.end() && extras->is_object()) {
        SR_TRY(const auto label, file_.integer(*extras, "label"));
        if (label && (*label < 0 || *label > 254))
            return fail(ErrorCode::bad_input, "{}: extras: label {}, expected a class", where, *label);
        view.label = label ? uint8_t(*label) : kNoLabel;
    }
    mesh_.materials.push_back(std::move(material));
    views_.push_back(view);
    return {};
}

Status GltfMaterials::read()
{
    SR_TRY(const size_t count, file_.count("materials"));
    for (size_t i = 0; i < count; ++i) {
        SR_TRY(const Json* json, file_.entry("materials", int64_t(i)));
        SR_CHECK(read_material(*json, fmt::format("{}: materials[{}]", where_, i)));
    }
    mesh_.materials.emplace_back(); // of primitives without one
    views_.emplace_back();
    return {};
}

uint32_t GltfMaterials::untextured(uint32_t material)
{
    const auto [entry, is_new] = untextured_.try_emplace(material, uint32_t(mesh_.materials.size()));
    if (is_new) {
        Material plain = mesh_.materials[material];
        plain.texture = plain.alpha_texture = -1;
        mesh_.materials.push_back(std::move(plain));
    }
    return entry->second;
}

} // namespace semrover
