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
    Splats splats{.position = triples(c.positions),
                  .normal = triples(c.normals),
                  .color = triples(c.colors),
                  .opacity = c.opacities};
    for (size_t i = 0; i + 1 < c.scales.size(); i += 2) {
        splats.sigma_u.push_back(c.scales[i]);
        splats.sigma_v.push_back(c.scales[i + 1]);
    }
    splats.label.resize(splats.position.size());
    SR_TRY(const SplatScene scene, SplatScene::create(device, splats));
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
    TensorPool memory;
    const DeviceTensor points = memory.tensor(n, 3, DType::f32, "points", 3),
                       normals = memory.tensor(n, 4, DType::f32, "normals", 4);
    const DeviceTensor eigenvalues = memory.tensor(n, 4, DType::f32, "eigenvalues", 4);
    SR_CHECK(memory.allocate(device, "points"));
    SR_CHECK(points.write(device, positions));
    Graph g(device.limits());
    const Tensor x = points.in(g);
    const PcaNormals y = pca_normal(g, x, knn(g, x, {.neighbors = neighbors}));
    g.keep(y.normals, normals);
    g.keep(y.eigenvalues, eigenvalues);
    SR_TRY(const auto executable, Executable::create(device, g));
    SR_CHECK(executable->run());
    PcaNormalsResult out;
    for (const auto& [slot, values] : {std::pair{normals, &out.normals}, {eigenvalues, &out.eigenvalues}}) {
        SR_TRY(const std::vector<float> rows, slot.read<float>(device));
        for (size_t i = 0; i < n; ++i)
            values->insert(values->end(), rows.begin() + 4 * i, rows.begin() + 4 * i + 3);
    }
    return out;
}

} // namespace semrover
