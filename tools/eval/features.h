// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"
#include "runtime/base/result.h"

#include <cstdint>
#include <string>
#include <vector>

namespace semrover {

// what a network says of N samples: D numbers of each
struct Features {
    uint32_t rows = 0, cols = 0;
    std::vector<double> values; // [rows, cols]
    std::string network;        // what made them: metadata "network" of the file, or empty

    const double* row(size_t i) const { return &values[i * cols]; }
};

// first two moments of a distribution over D numbers
struct Gaussian {
    uint32_t size = 0;
    std::vector<double> mean;       // [size]
    std::vector<double> covariance; // [size, size], symmetric
};

constexpr uint32_t kMaxFeatures = 8192; // D, at most

// A .safetensors file with `features` [N, D] (F16, BF16, F32 or F64). Errors, bad_input: another shape, fewer than one
// row, more than kMaxFeatures columns, NaN or infinity (where it is), other tensors.
Result<Features> read_features(const Path& path);
// as F32, atomically, with `network`
Status write_features(const Path& path, const Features& features);

// A .safetensors file with `mu` [D] and `sigma` [D, D] (F16, BF16, F32 or F64). Errors, bad_input: likewise, and a
// sigma that is not symmetric (by more than 1e-3 of its largest number) or has a negative variance
Result<Gaussian> read_gaussian(const Path& path);

// which of the two a file is; bad_input, naming both layouts, when it is neither
enum class FeatureFile { features, gaussian };
Result<FeatureFile> feature_file_kind(const Path& path);

} // namespace semrover
