// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/verify/splat_cases.h"

namespace semrover {

namespace {

std::vector<std::array<float, 3>> triples(const std::vector<float>& values)
{
    std::vector<std::array<float, 3>> out;
    for (size_t i = 0; i + 2 < values.size(); i += 3)
        out.push_back({values[i], values[i + 1], values[i + 2]});
    return out;
}

} // namespace

Result<SplatImage> run_splat_render(Device& device, const SplatRenderCase& c)
{
    if (c.view.size() != 16 || c.intrinsics.size() != 9)
        return fail(ErrorCode::bad_input, "splat_render: view of {} numbers, intrinsics of {}", c.view.size(),
                    c.intrinsics.size());
    Surfels surfels{.position = triples(c.positions),
                    .normal = triples(c.normals),
                    .color = triples(c.colors),
                    .opacity = c.opacities};
    for (size_t i = 0; i + 1 < c.scales.size(); i += 2) {
        surfels.sigma_u.push_back(c.scales[i]);
        surfels.sigma_v.push_back(c.scales[i + 1]);
    }
    surfels.label.resize(surfels.position.size());
    SR_TRY(const SurfelScene scene, SurfelScene::create(device, surfels));
    RasterizerOptions options{.near = c.near,
                              .alpha_min = c.alpha_min,
                              .alpha_max = c.alpha_max,
                              .transmittance_min = c.transmittance_min,
                              .screen_variance = c.screen_filter_variance,
                              .cutoff = c.cutoff_sigma};
    SR_TRY(const auto rasterizer, Rasterizer::create(device, scene, c.width, c.height, 1, options));
    SplatCamera camera{c.intrinsics[0], c.intrinsics[4], c.intrinsics[2], c.intrinsics[5], {}};
    std::copy_n(c.view.begin(), 12, camera.world_to_camera.begin());
    SR_TRY(auto images, rasterizer->render({&camera, 1}));
    return std::move(images.front());
}

Result<PcaNormalsResult> run_pca_normals(Device& device, std::span<const float> positions, uint32_t neighbors)
{
    const uint32_t n = uint32_t(positions.size() / 3);
    if (n == 0 || positions.size() % 3 || neighbors < 1 || neighbors > kMaxNeighbors)
        return fail(ErrorCode::bad_input, "pca_normals: {} numbers, {} neighbours", positions.size(), neighbors);
    Arena memory;
    const uint32_t points = memory.add(12ull * n), normals = memory.add(16ull * n), eigenvalues = memory.add(16ull * n);
    SR_CHECK(memory.allocate(device, "points"));
    SR_CHECK(device.write(memory.slice(points), std::as_bytes(positions)));
    Graph g;
    const Tensor x = g.external(memory.slice(points), n, 3, DType::f32, "points", 3);
    const PcaNormals y = pca_normal(g, x, knn(g, x, {.neighbors = neighbors}));
    g.replace(y.normals.resource, g.external(memory.slice(normals), n, 4, DType::f32, "normals", 4).resource);
    g.replace(y.eigenvalues.resource,
              g.external(memory.slice(eigenvalues), n, 4, DType::f32, "eigenvalues", 4).resource);
    SR_TRY(const auto program, Program::create(device, g));
    SR_CHECK(program->run());
    PcaNormalsResult out;
    std::vector<float> rows(4 * size_t(n));
    for (const auto& [slice, values] : {std::pair{normals, &out.normals}, {eigenvalues, &out.eigenvalues}}) {
        SR_CHECK(device.read(memory.slice(slice), std::as_writable_bytes(std::span(rows))));
        for (size_t i = 0; i < n; ++i)
            values->insert(values->end(), rows.begin() + 4 * i, rows.begin() + 4 * i + 3);
    }
    return out;
}

} // namespace semrover
