// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"
#include "runtime/base/safetensors_header.h"

#include <cstring>
#include <functional>
#include <memory>

namespace semrover {

// one safetensors file, mapped and fully checked when it is opened. Errors are bad_input and name the file.
class Safetensors {
  public:
    static Result<Safetensors> open(const Path& path, const SafetensorsLimits& limits = {});

    const Path& path() const { return path_; }
    const std::vector<TensorInfo>& tensors() const { return header_.tensors; } // by name
    const std::vector<UnsupportedTensor>& unsupported() const { return header_.unsupported; }
    const std::map<std::string, std::string>& metadata() const { return header_.metadata; }

    const TensorInfo* find(std::string_view name) const; // null when absent or of an unsupported dtype
    Result<const TensorInfo*> get(std::string_view name) const;

    // a tensor's elements, row-major, little endian; valid as long as this object
    // note: older writers did not align the data. Copy (memcpy) before reading as anything wider than a byte.
    std::span<const std::byte> bytes(const TensorInfo& tensor) const
    {
        return file_.bytes().subspan(header_.data_begin + tensor.begin, tensor.bytes());
    }

  private:
    Path path_;
    MappedFile file_;
    SafetensorsHeader header_;
};

// what a model says one of its tensors must be
struct TensorSpec {
    std::string name;
    std::vector<uint64_t> shape;
    bool optional = false;
    std::vector<DType> dtypes = {DType::f32, DType::f16, DType::bf16}; // any of these
};

enum class Unexpected { refuse, ignore }; // tensors that no TensorSpec names

// the tensors of one component: a file, or the shards that an index names
class SafetensorsSet {
  public:
    // a .safetensors file, or a .safetensors.index.json whose shards lie beside it: shard names without folders, every
    // tensor in exactly the shard the index says, metadata.total_size (if any) the true sum. A .bin, .pt, .pth, .ckpt
    // or .pkl is refused with the way to convert it.
    static Result<SafetensorsSet> open(const Path& path, const SafetensorsLimits& limits = {});

    // the weights called `base` in a component's folder: base.fp16.safetensors, else base.safetensors, else the same
    // as an index (base.safetensors.index.fp16.json, base.safetensors.index.json)
    static Result<SafetensorsSet> open_folder(const Path& folder, std::string_view base = "diffusion_pytorch_model",
                                              const SafetensorsLimits& limits = {});

    const Path& path() const { return path_; } // what was opened: the file or the index
    const std::vector<Safetensors>& shards() const { return shards_; }
    const std::vector<TensorInfo>& tensors() const { return tensors_; } // by name; `shard` is set
    const std::vector<UnsupportedTensor>& unsupported() const { return unsupported_; }

    const TensorInfo* find(std::string_view name) const;
    Result<const TensorInfo*> get(std::string_view name) const;
    std::span<const std::byte> bytes(const TensorInfo& tensor) const { return shards_[tensor.shard].bytes(tensor); }

    // the file holds what the model needs: one error lists all missing, misshapen, wrongly typed and (unless ignored)
    // unexpected tensors, with expected and actual shape. Only names with `prefix` can be unexpected.
    Status require(std::span<const TensorSpec> schema, Unexpected unexpected = Unexpected::refuse,
                   std::string_view prefix = {}) const;

  private:
    static Result<SafetensorsSet> open_index(const Path& path, const SafetensorsLimits& limits);

    Path path_;
    std::vector<Safetensors> shards_;
    std::vector<TensorInfo> tensors_;
    std::vector<UnsupportedTensor> unsupported_;
};

// the elements of a tensor, copied out because the file may not align them; none when it is absent
template <typename T>
std::vector<T> elements(const SafetensorsSet& file, std::string_view name)
{
    const TensorInfo* tensor = file.find(name);
    if (!tensor || tensor->bytes() == 0)
        return {};
    std::vector<T> values(tensor->bytes() / sizeof(T));
    std::memcpy(values.data(), file.bytes(*tensor).data(), values.size() * sizeof(T));
    return values;
}

// bad_input for the first tensor with a NaN or infinity, with its index
Status check_finite(const SafetensorsSet& set);
Status check_finite(const SafetensorsSet& set, const TensorInfo& tensor);

struct TensorData {
    std::string name;
    DType dtype;
    std::vector<uint64_t> shape;
    std::span<const std::byte> bytes; // row-major, little endian
};

// writes a file atomically, with the same bytes for the same input in any order: tensors by descending element size,
// then by name, so that each is aligned; the header is padded with spaces to 8 bytes. A size that is not its shape's,
// a name given twice or one that the reader would refuse is the caller's bug.
Status write_safetensors(const Path& path, std::span<const TensorData> tensors,
                         const std::map<std::string, std::string>& metadata = {});
// the bytes of such a file
std::vector<std::byte> encode_safetensors(std::span<const TensorData> tensors,
                                          const std::map<std::string, std::string>& metadata = {});

// a tensor that makes its bytes when they are written, so that a file may be larger than memory
struct TensorStream {
    std::string name;
    DType dtype;
    std::vector<uint64_t> shape;
    // the bytes are valid until the next call for any tensor; they may be in `scratch`
    std::function<Result<std::span<const std::byte>>(std::vector<std::byte>& scratch)> bytes;
};
Status stream_safetensors(const Path& path, std::span<const TensorStream> tensors,
                          const std::map<std::string, std::string>& metadata = {});

// a file's tensor, as it is stored or as another of F32, F16 and BF16 (others stay what they are); bad_input when one
// of its numbers is NaN or infinite, or becomes so as F16
TensorStream stream_tensor(std::shared_ptr<const SafetensorsSet> set, const TensorInfo& tensor,
                           std::optional<DType> dtype = {});
// numbers as a file's F32, F16 or BF16, into `scratch`; bad_input as above, `what` names the tensor
Result<std::span<const std::byte>> encode_floats(std::span<const float> values, DType dtype, std::string_view what,
                                                 std::vector<std::byte>& scratch);

} // namespace semrover
