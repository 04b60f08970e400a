// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/graph/limits.h"

#include "runtime/graph/kernel.h"

#include <cstdlib>
#include <sstream>

namespace semrover {

namespace {

template <typename T>
Status lower(T& limit, const std::string& key, double value)
{
    if (value > double(limit))
        return fail(ErrorCode::usage, "limit '{}': {} is more than the device's {}", key, value, limit);
    limit = T(value);
    return {};
}

Status apply(DeviceLimits& limits, const std::string& key, const std::string& text)
{
    if (key == "variant") {
        limits.force_variant = text;
        return {};
    }
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    if (text.empty() || *end || !(value >= 0))
        return fail(ErrorCode::usage, "limit '{}': '{}' is not a number", key, text);
    if (key == "shared")
        return lower(limits.max_shared_bytes, key, value);
    if (key == "range")
        return lower(limits.max_storage_range, key, value);
    if (key == "texels")
        return lower(limits.max_texel_elements, key, value);
    if (key == "alloc")
        return lower(limits.max_allocation, key, value);
    if (key == "groups")
        return lower(limits.max_groups, key, value);
    if (key == "buffers")
        return lower(limits.max_storage_buffers, key, value);
    if (key == "fp16") {
        if (value == 0)
            limits.features &= ~uint32_t(kFeatureFloat16 | kFeatureCooperativeMatrix);
        return {};
    }
    if (key == "coopmat") {
        if (value == 0)
            limits.features &= ~uint32_t(kFeatureCooperativeMatrix);
        return {};
    }
    if (key == "subgroups") {
        if (value == 0)
            limits.features &= ~uint32_t(kFeatureSubgroupArithmetic | kFeatureSubgroupBallot | kFeatureSubgroupShuffle |
                                         kFeatureSubgroupVote);
        return {};
    }
    if (key == "staging") {
        limits.force_staging = value != 0;
        return {};
    }
    if (key == "branches") {
        limits.side_by_side = value != 0;
        return {};
    }
    if (key == "submit") {
        limits.submit_seconds = value;
        return {};
    }
    return fail(ErrorCode::usage,
                "unknown limit '{}' (known: shared, range, texels, alloc, groups, buffers, fp16, coopmat, subgroups, "
                "staging, branches, submit, variant)",
                key);
}

} // namespace

std::string kernels_text(const DeviceLimits& limits)
{
    const MatrixShape& m = limits.matrix;
    return fmt::format("features {:#x}, subgroup {}, matrix {}x{}x{}, {}", limits.features, limits.subgroup_size, m.m,
                       m.n, m.k, limits.force_variant.empty() ? "any variant" : limits.force_variant);
}

Status override_limits(DeviceLimits& limits, const std::string& text)
{
    std::stringstream in(text);
    for (std::string item; std::getline(in, item, ',');) {
        const size_t equals = item.find('=');
        if (equals == std::string::npos)
            return fail(ErrorCode::usage, "limit '{}': expected name=value", item);
        SR_CHECK(apply(limits, item.substr(0, equals), item.substr(equals + 1)));
    }
    return {};
}

} // namespace semrover
