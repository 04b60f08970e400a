// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// golden kinds splat_render and pca_normals; storage is fp32 whatever the precision
#include "tools/verify/golden_case.h"
#include "tools/verify/splat_cases.h"

namespace semrover {

Result<GoldenOutputs> run_splat_render(Device& device, const GoldenCase& c, DType)
{
    SplatRenderCase s;
    s.positions = c.floats("input.positions");
    s.normals = c.floats("input.normals");
    s.colors = c.floats("input.colors");
    s.opacities = c.floats("input.opacities");
    s.scales = c.floats("input.scales");
    s.view = c.floats("input.view");
    s.intrinsics = c.floats("input.intrinsics");
    const auto read = [&](const char* name, auto& value) -> Status {
        SR_TRY(const double v, c.number(name));
        value = std::decay_t<decltype(value)>(v);
        return {};
    };
    SR_CHECK(read("width", s.width));
    SR_CHECK(read("height", s.height));
    SR_CHECK(read("near", s.near));
    SR_CHECK(read("alpha_min", s.alpha_min));
    SR_CHECK(read("alpha_max", s.alpha_max));
    SR_CHECK(read("transmittance_min", s.transmittance_min));
    SR_CHECK(read("screen_filter_variance", s.screen_filter_variance));
    SR_CHECK(read("cutoff_sigma", s.cutoff_sigma));
    SR_TRY(SplatImage image, run_splat_render(device, s));
    GoldenOutputs out;
    out.floats["color"] = std::move(image.color);
    out.floats["alpha"] = std::move(image.alpha);
    out.floats["depth"] = std::move(image.depth_sum);
    out.floats["normal"] = std::move(image.normal);
    return out;
}

Result<GoldenOutputs> run_pca_normals(Device& device, const GoldenCase& c, DType)
{
    SR_TRY(const double neighbors, c.number("neighbours"));
    SR_TRY(PcaNormalsResult result, run_pca_normals(device, c.floats("input.positions"), uint32_t(neighbors)));
    // a normal is compared up to its sign
    const std::vector<float> expect = c.floats("expect.normals");
    for (size_t i = 0; i + 2 < result.normals.size() && i + 2 < expect.size(); i += 3) {
        const float dot = result.normals[i] * expect[i] + result.normals[i + 1] * expect[i + 1] +
                          result.normals[i + 2] * expect[i + 2];
        for (size_t a = 0; a < 3 && dot < 0; ++a)
            result.normals[i + a] = -result.normals[i + a];
    }
    GoldenOutputs out;
    out.floats["normals"] = std::move(result.normals);
    out.floats["eigenvalues"] = std::move(result.eigenvalues);
    return out;
}

} // namespace semrover
