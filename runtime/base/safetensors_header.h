// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/dtype.h"
#include "runtime/base/result.h"

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace semrover {

// format: https://github.com/huggingface/safetensors (u64 little-endian header length, JSON header, data)
constexpr uint64_t kMaxSafetensorsHeader = 100'000'000; // bytes, the reference reader's limit
constexpr uint64_t kMaxTensors = 65'536;
constexpr uint64_t kMaxMetadataEntries = 65'536;
constexpr size_t kMaxTensorName = 512; // bytes; metadata keys too
constexpr size_t kMaxRank = 8;
constexpr uint64_t kMaxDim = uint64_t(1) << 40;

struct SafetensorsLimits {
    uint64_t header_bytes = kMaxSafetensorsHeader;
    bool strict = false; // also refuse white space before the header's '{', which the reference reader lets pass
};

struct TensorInfo {
    std::string name;
    DType dtype;
    std::vector<uint64_t> shape; // outermost first; empty for a scalar
    uint64_t begin = 0, end = 0; // bytes [begin, end) of the data section of its file
    uint32_t shard = 0;          // file of a SafetensorsSet

    uint64_t bytes() const { return end - begin; }
    uint64_t elements() const { return bytes() / dtype_bytes(dtype); }
};

// a tensor whose dtype the engine does not use (F8_E4M3, C64, or an unknown one): its range is checked, it can be
// listed, it cannot be read
struct UnsupportedTensor {
    std::string name;
    std::string dtype; // as in the file
    std::vector<uint64_t> shape;
    uint64_t begin = 0, end = 0;
};

struct SafetensorsHeader {
    std::vector<TensorInfo> tensors;            // by name
    std::vector<UnsupportedTensor> unsupported; // by name
    std::map<std::string, std::string> metadata;
    uint64_t data_begin = 0; // where the data section starts in the file
};

// bytes of a dense tensor: the only place where a shape becomes a size. An error says which limit is broken: rank over
// kMaxRank, a dimension over kMaxDim, a product over 2^64 bits, or a size that is no whole number of bytes.
Result<uint64_t> checked_bytes(std::span<const uint64_t> shape, uint32_t bits_per_element);
Result<uint64_t> checked_bytes(std::span<const uint64_t> shape, DType dtype);

std::string shape_text(std::span<const uint64_t> shape); // "[2, 3]"

// reads and checks the header of a whole file: limits above; no duplicate key at any level; whole numbers written as
// digits up to 2^53; the tensors cover the data section exactly, without hole or overlap; each range has the size that
// shape and dtype ask for. `where` names the file in errors (bad_input).
Result<SafetensorsHeader> parse_safetensors_header(std::span<const std::byte> file, std::string_view where,
                                                   const SafetensorsLimits& limits = {});

} // namespace semrover
