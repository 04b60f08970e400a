// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/gltf_pose.h"

#include "engine/format/gltf_document.h"
#include "runtime/base/json_fields.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

// of any length but 0
GltfMatrix turned_by(const std::array<double, 4>& q)
{
    const double x = q[0], y = q[1], z = q[2], w = q[3], n = x * x + y * y + z * z + w * w, k = n > 0 ? 2 / n : 0;
    return {1 - k * (y * y + z * z), k * (x * y - w * z),     k * (x * z + w * y),     0, //
            k * (x * y + w * z),     1 - k * (x * x + z * z), k * (y * z - w * x),     0, //
            k * (x * z - w * y),     k * (y * z + w * x),     1 - k * (x * x + y * y), 0, 0, 0, 0, 1};
}

template <size_t N>
std::array<double, N> numbers_in(const GltfAccessor& a, size_t i)
{
    std::array<double, N> out;
    for (uint32_t c = 0; c < N; ++c)
        out[c] = a.number(i, c);
    return out;
}

// that are read, or that change neither where a surface is nor how it looks by itself
bool is_known(std::string_view name)
{
    constexpr std::string_view kKnown[] = {"EXT_mesh_gpu_instancing", "KHR_node_visibility",
                                           "KHR_node_selectability",  "KHR_node_hoverability",
                                           "KHR_mesh_quantization",   "KHR_draco_mesh_compression",
                                           "KHR_lights_punctual",     "KHR_materials_variants",
                                           "KHR_animation_pointer",   "KHR_xmp",
                                           "KHR_xmp_json_ld",         "KHR_audio_emitter",
                                           "KHR_interactivity",       "MSFT_lod",
                                           "EXT_mesh_features",       "EXT_structural_metadata",
                                           "EXT_instance_features",   "EXT_lights_image_based"};
    return std::ranges::find(kKnown, name) != std::end(kKnown);
}

} // namespace

std::array<double, 3> transformed(const GltfMatrix& m, const std::array<double, 3>& p)
{
    std::array<double, 3> to;
    for (size_t r = 0; r < 3; ++r)
        to[r] = m[4 * r] * p[0] + m[4 * r + 1] * p[1] + m[4 * r + 2] * p[2] + m[4 * r + 3];
    return to;
}

double determinant(const GltfMatrix& m)
{
    return m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
           m[2] * (m[4] * m[9] - m[5] * m[8]);
}

GltfMatrix GltfInstances::matrix(size_t i) const
{
    GltfMatrix m = rotation ? turned_by(numbers_in<4>(*rotation, i)) : kGltfIdentity;
    for (size_t r = 0; r < 3; ++r) {
        for (uint32_t c = 0; c < 3 && scale; ++c)
            m[4 * r + c] *= scale->number(i, c);
        m[4 * r + 3] = translation ? translation->number(i, uint32_t(r)) : 0;
    }
    return m;
}

void GltfPose::note_extensions(const Json& object)
{
    const auto all = object.find("extensions");
    if (all == object.end() || !all->is_object())
        return;
    for (const auto& [name, value] : all->items())
        if (!is_known(name) && noted_.size() < 100 && noted_.insert(name).second)
            add_warning(warnings,
                        fmt::format("{}: the extension {} of nodes or primitives is ignored", where_, quote(name, 60)));
}

Status GltfPose::count_work(uint64_t elements, std::string_view what)
{
    work_ += std::min(elements, most_ + 1);
    if (work_ > most_)
        return fail(
            ErrorCode::bad_input,
            "{}: {} {} with instances, joints and morphed vertices before them, at most {} from files of {} bytes",
            where_, work_, what, most_, file_.bytes());
    return {};
}

Result<std::vector<int64_t>> GltfPose::indices_in(const Json& object, const char* key) const
{
    std::vector<int64_t> out;
    const auto list = object.find(key);
    if (list == object.end())
        return out;
    SR_CHECK(check_array(*list, key, where_));
    for (const Json& value : *list) {
        if (!value.is_number_integer() || value < 0)
            return fail(ErrorCode::bad_input, "{}: {}: expected a list of numbers", where_, key);
        out.push_back(value.get<int64_t>());
    }
    return out;
}

// that are no child, and no coarser shape of a node (MSFT_lod)
Result<std::vector<int64_t>> GltfPose::orphans() const
{
    SR_TRY(const size_t nodes, file_.count("nodes"));
    std::vector<bool> is_child(nodes);
    const auto mark = [&](const std::vector<int64_t>& children) {
        for (const int64_t child : children)
            if (child < int64_t(is_child.size()))
                is_child[size_t(child)] = true;
    };
    for (size_t i = 0; i < is_child.size(); ++i) {
        SR_TRY(const Json* node, file_.entry("nodes", int64_t(i)));
        SR_TRY(const std::vector<int64_t> children, indices_in(*node, "children"));
        mark(children);
        if (const Json* lod = extension_of(*node, "MSFT_lod")) {
            SR_TRY(const std::vector<int64_t> shapes, indices_in(*lod, "ids"));
            mark(shapes);
        }
    }
    std::vector<int64_t> out;
    for (size_t i = 0; i < is_child.size(); ++i)
        if (!is_child[i])
            out.push_back(int64_t(i));
    return out;
}

// of the default scene, the first one, or all
Result<std::vector<int64_t>> GltfPose::roots() const
{
    SR_TRY(const auto scene, file_.integer(file_.json(), "scene"));
    SR_TRY(const size_t scenes, file_.count("scenes"));
    if (!scene && !scenes)
        return orphans();
    SR_TRY(const Json* json, file_.entry("scenes", scene.value_or(0)));
    return indices_in(*json, "nodes");
}

Result<GltfMatrix> GltfPose::matrix_of(const Json& node, const std::string& where) const
{
    SR_TRY(const auto columns, file_.numbers(node, "matrix", 16, where));
    GltfMatrix m = kGltfIdentity;
    if (!columns.empty()) {
        for (size_t r = 0; r < 4; ++r)
            for (size_t c = 0; c < 4; ++c)
                m[4 * r + c] = columns[4 * c + r];
        return m;
    }
    SR_TRY(const auto t, file_.numbers(node, "translation", 3, where));
    SR_TRY(const auto q, file_.numbers(node, "rotation", 4, where));
    SR_TRY(const auto s, file_.numbers(node, "scale", 3, where));
    if (!q.empty()) {
        const double n = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
        if (!(n > 0.81 && n < 1.21))
            return fail(ErrorCode::bad_input, "{}: rotation: a quaternion of length {:.4g}, expected 1", where,
                        std::sqrt(n));
        m = turned_by({q[0], q[1], q[2], q[3]});
    }
    for (size_t r = 0; r < 3; ++r) {
        for (size_t c = 0; c < 3 && !s.empty(); ++c)
            m[4 * r + c] *= s[c];
        m[4 * r + 3] = t.empty() ? 0 : t[r];
    }
    return m;
}

// marked when it is put on the list, so that the list has each node once
Status GltfPose::push(int64_t node, const GltfMatrix& parent, bool visible)
{
    SR_CHECK(file_.entry("nodes", node).map([](const Json*) {}));
    if (visited_[size_t(node)])
        return fail(ErrorCode::bad_input, "{}: nodes[{}]: is the child of two nodes, or of itself", where_, node);
    visited_[size_t(node)] = true;
    pending_.push_back({node, parent, visible});
    return {};
}

Status GltfPose::walk(const std::vector<int64_t>& from, bool in_scene, std::vector<GltfPlacement>& out)
{
    for (auto i = from.rbegin(); i != from.rend(); ++i)
        SR_CHECK(push(*i, kGltfIdentity, in_scene));
    while (!pending_.empty()) {
        const Pending next = pending_.back();
        pending_.pop_back();
        SR_TRY(const Json* node, file_.entry("nodes", next.node));
        SR_TRY(const GltfMatrix own, matrix_of(*node, fmt::format("{}: nodes[{}]", where_, next.node)));
        const GltfMatrix matrix = compose(next.parent, own);
        if (!matrices_.empty())
            matrices_[size_t(next.node)] = matrix;
        const Json* visibility = extension_of(*node, "KHR_node_visibility");
        const bool visible = next.visible && !(visibility && visibility->value("visible", Json(true)) == false);
        SR_TRY(const auto mesh, file_.integer(*node, "mesh"));
        if (visible)
            note_extensions(*node);
        if (mesh && visible)
            out.push_back({*mesh, node, matrix});
        SR_TRY(const std::vector<int64_t> children, indices_in(*node, "children"));
        for (const int64_t child : children)
            SR_CHECK(push(child, matrix, visible));
    }
    return {};
}

Result<std::vector<GltfPlacement>> GltfPose::placements()
{
    SR_TRY(const size_t nodes, file_.count("nodes"));
    SR_TRY(const size_t skins, file_.count("skins"));
    visited_.assign(nodes, false);
    if (skins)
        matrices_.assign(nodes, kGltfIdentity);
    std::vector<GltfPlacement> out;
    SR_TRY(const std::vector<int64_t> scene, roots());
    SR_CHECK(walk(scene, true, out));
    if (!skins)
        return out;
    SR_TRY(std::vector<int64_t> others, orphans()); // joints may lie outside of the scene
    std::erase_if(others, [&](int64_t node) { return visited_[size_t(node)]; });
    SR_CHECK(walk(others, false, out));
    return out;
}

Result<GltfInstances> GltfPose::instances(const Json& node)
{
    GltfInstances out;
    const Json* json = extension_of(node, "EXT_mesh_gpu_instancing");
    if (!json)
        return out;
    const std::string where = where_ + ": EXT_mesh_gpu_instancing";
    const auto attributes = json->find("attributes");
    if (attributes == json->end() || !attributes->is_object())
        return fail(ErrorCode::bad_input, "{}: expected attributes", where);
    std::optional<size_t> count;
    const auto read = [&](const char* name, uint32_t components, std::optional<GltfAccessor>& to) -> Status {
        SR_TRY(const auto index, file_.integer(*attributes, name));
        if (!index)
            return {};
        SR_TRY(to, file_.accessor(*index));
        if (to->components != components || to->component == 5125 || (to->component != 5126 && !to->normalized))
            return fail(ErrorCode::bad_input, "{}: {}: expected {} floats, or normalized bytes or shorts", where, name,
                        components);
        if (count.value_or(to->count) != to->count)
            return fail(ErrorCode::bad_input, "{}: {} has {} entries, those before it {}", where, name, to->count,
                        *count);
        count = to->count;
        return {};
    };
    SR_CHECK(read("TRANSLATION", 3, out.translation));
    SR_CHECK(read("ROTATION", 4, out.rotation));
    SR_CHECK(read("SCALE", 3, out.scale));
    if (!count)
        return fail(ErrorCode::bad_input, "{}: has no TRANSLATION, ROTATION or SCALE", where);
    out.count = *count;
    SR_CHECK(count_work(out.count, "instances"));
    return out;
}

Result<std::vector<GltfMatrix>> GltfPose::joints(int64_t index)
{
    SR_TRY(const Json* skin, file_.entry("skins", index));
    const std::string where = fmt::format("{}: skins[{}]", where_, index);
    SR_TRY(const std::vector<int64_t> nodes, indices_in(*skin, "joints"));
    SR_TRY(const auto given, file_.integer(*skin, "inverseBindMatrices"));
    if (nodes.size() > matrices_.size())
        return fail(ErrorCode::bad_input, "{}: has {} joints, the file {} nodes", where, nodes.size(),
                    matrices_.size());
    SR_CHECK(count_work(nodes.size(), "joints"));
    std::optional<GltfAccessor> inverse;
    if (given) {
        SR_TRY(inverse, file_.accessor(*given));
        if (inverse->components != 16 || inverse->component != 5126 || inverse->count < nodes.size())
            return fail(ErrorCode::bad_input, "{}: inverseBindMatrices: expected {} matrices of floats", where,
                        nodes.size());
    }
    std::vector<GltfMatrix> out;
    for (size_t i = 0; i < nodes.size(); ++i) {
        if (nodes[i] >= int64_t(matrices_.size()))
            return fail(ErrorCode::bad_input, "{}: refers to nodes[{}], there are {}", where, nodes[i],
                        matrices_.size());
        GltfMatrix bind = kGltfIdentity;
        for (uint32_t c = 0; c < 16 && inverse; ++c)
            bind[4 * (c % 4) + c / 4] = inverse->number(i, c); // columns in the file
        out.push_back(compose(matrices_[size_t(nodes[i])], bind));
    }
    if (out.empty())
        return fail(ErrorCode::bad_input, "{}: has no joints", where);
    return out;
}

Result<std::vector<double>> GltfPose::weights(const Json& node, const Json& mesh) const
{
    for (const Json* object : {&node, &mesh})
        if (const auto found = object->find("weights"); found != object->end())
            return numbers_of(*found, where_ + ": weights");
    return std::vector<double>();
}

} // namespace semrover
