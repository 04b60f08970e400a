// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"
#include "runtime/base/safetensors.h"
#include "runtime/device/device.h"

#include <map>
#include <optional>

namespace semrover {

// one golden case: a folder with case.json, tensors.safetensors and perhaps model/ (tests/golden/README.md)
class GoldenCase {
  public:
    static Result<GoldenCase> open(const Path& folder);

    const std::string& name() const { return name_; }
    const std::string& kind() const { return kind_; }
    const nlohmann::json& params() const { return params_; }
    Path model() const { return folder_ / model_; }

    bool has(const std::string& tensor) const { return tensors_.find(tensor) != nullptr; }
    std::vector<uint64_t> shape(const std::string& tensor) const;
    // elements as T, converted; an empty vector when the case has no such tensor
    std::vector<float> floats(const std::string& tensor) const;
    std::vector<int64_t> integers(const std::string& tensor) const;

    // 3.33 or a number in params; errors name the parameter
    Result<double> number(const char* param) const;

    double tolerance(const std::string& precision) const { return tolerance_.value(precision, 0.0); }
    double outlier_fraction() const { return tolerance_.value("outlier_fraction", 0.0); }
    double outlier_factor() const { return tolerance_.value("outlier_factor", 1.0); }
    std::vector<std::string> expected() const; // names without "expect."

  private:
    explicit GoldenCase(Safetensors tensors) : tensors_(std::move(tensors)) {}

    Path folder_;
    std::string name_, kind_, model_;
    nlohmann::json params_, tolerance_;
    Safetensors tensors_;
};

// what a run of a case gave, by the name after "expect."
struct GoldenOutputs {
    std::map<std::string, std::vector<float>> floats;
    std::map<std::string, std::vector<int64_t>> integers;
    std::map<std::string, std::vector<uint8_t>> ignored; // elements that are not compared (padding)
};

struct GoldenVerdict {
    bool passed = false;
    double max_error = 0; // largest |got - expect| / max(1, max|expect|) over all tensors, outliers left out
    std::string reason;   // of a failure that is not an error's size
};

// README.md's rule: |got - expect| <= tolerance * max(1, max|expect|); integers equal
GoldenVerdict compare(const GoldenCase& c, const GoldenOutputs& got, const std::string& precision);

// one runner per kind; fp16 changes storage, never the case
using GoldenRunner = Result<GoldenOutputs> (*)(Device& device, const GoldenCase& c, DType precision);
Result<GoldenOutputs> run_voxfield_transformer(Device& device, const GoldenCase& c, DType precision);
Result<GoldenOutputs> run_voxfield_sampling(Device& device, const GoldenCase& c, DType precision);
Result<GoldenOutputs> run_scheduler(Device& device, const GoldenCase& c, DType precision);
Result<GoldenOutputs> run_repaint_timesteps(Device& device, const GoldenCase& c, DType precision);
Result<GoldenOutputs> run_region_extraction(Device& device, const GoldenCase& c, DType precision);
Result<GoldenOutputs> run_splat_render(Device& device, const GoldenCase& c, DType precision);
Result<GoldenOutputs> run_pca_normals(Device& device, const GoldenCase& c, DType precision);
Result<GoldenOutputs> run_asd_rollout(Device& device, const GoldenCase& c, DType precision);
Result<GoldenOutputs> run_vsd_window(Device& device, const GoldenCase& c, DType precision);

Result<GoldenOutputs> run_unet_2d_condition(Device& device, const GoldenCase& c, DType precision);
Result<GoldenOutputs> run_unet_spatio_temporal_condition(Device& device, const GoldenCase& c, DType precision);
Result<GoldenOutputs> run_autoencoder_kl_temporal_decoder(Device& device, const GoldenCase& c, DType precision);
Result<GoldenOutputs> run_mesh_voxelization(Device& device, const GoldenCase& c, DType precision);
Result<GoldenOutputs> run_autoencoder_kl(Device& device, const GoldenCase& c, DType precision);

} // namespace semrover
