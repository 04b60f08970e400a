// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "runtime/base/safetensors.h"

#include <algorithm>
#include <set>

namespace semrover {

namespace {

uint64_t bytes_of(const TensorStream& t)
{
    const Result<uint64_t> bytes = checked_bytes(t.shape, t.dtype);
    SR_ASSERT(bytes, "tensor {} has shape {}", t.name, shape_text(t.shape));
    SR_ASSERT(t.name.size() <= kMaxTensorName && t.name != "__metadata__", "tensor name {}", t.name);
    return *bytes;
}

std::string header_text(std::span<const TensorStream* const> tensors,
                        const std::map<std::string, std::string>& metadata)
{
    std::string text = "{";
    if (!metadata.empty()) {
        text += "\"__metadata__\":{";
        for (const auto& [key, value] : metadata)
            text += json_text(Json(key)) + ":" + json_text(Json(value)) + ",";
        text.back() = '}';
        text += ',';
    }
    uint64_t offset = 0;
    for (const TensorStream* t : tensors) {
        const uint64_t end = offset + bytes_of(*t);
        text += fmt::format("{}:{{\"dtype\":\"{}\",\"shape\":[{}],\"data_offsets\":[{},{}]}},",
                            json_text(Json(t->name)), dtype_name(t->dtype), fmt::join(t->shape, ","), offset, end);
        offset = end;
    }
    if (text.back() == ',')
        text.pop_back();
    text += '}';
    text.resize((text.size() + 7) / 8 * 8, ' ');
    return text;
}

bool is_float(DType dtype)
{
    return dtype == DType::f32 || dtype == DType::f16 || dtype == DType::bf16;
}

// sink: takes the next bytes of the file
template <typename Sink>
Status put_file(std::span<const TensorStream> tensors, const std::map<std::string, std::string>& metadata, Sink&& sink)
{
    std::vector<const TensorStream*> order;
    std::set<std::string_view> names;
    for (const TensorStream& t : tensors) {
        SR_ASSERT(names.insert(t.name).second, "tensor {} given twice", t.name);
        order.push_back(&t);
    }
    std::ranges::sort(order, [](const TensorStream* a, const TensorStream* b) {
        const uint64_t size_a = dtype_bytes(a->dtype), size_b = dtype_bytes(b->dtype);
        return size_a != size_b ? size_a > size_b : a->name < b->name;
    });

    const std::string header = header_text(order, metadata);
    std::byte length[8];
    for (int i = 0; i < 8; ++i)
        length[i] = static_cast<std::byte>(uint64_t(header.size()) >> (8 * i));
    SR_CHECK(sink(std::span<const std::byte>(length)));
    SR_CHECK(sink(std::as_bytes(std::span(header))));
    std::vector<std::byte> scratch;
    for (const TensorStream* t : order) {
        SR_TRY(const std::span<const std::byte> bytes, t->bytes(scratch));
        SR_ASSERT(bytes.size() == bytes_of(*t), "tensor {}: {} {} given with {} bytes", t->name, dtype_name(t->dtype),
                  shape_text(t->shape), bytes.size());
        SR_CHECK(sink(bytes));
    }
    return {};
}

std::vector<TensorStream> streams_of(std::span<const TensorData> tensors)
{
    std::vector<TensorStream> streams;
    streams.reserve(tensors.size());
    for (const TensorData& t : tensors)
        streams.push_back(
            {t.name, t.dtype, t.shape, [&t](auto&) -> Result<std::span<const std::byte>> { return t.bytes; }});
    return streams;
}

} // namespace

Status stream_safetensors(const Path& path, std::span<const TensorStream> tensors,
                          const std::map<std::string, std::string>& metadata)
{
    SR_TRY(AtomicFile file, AtomicFile::create(path));
    SR_CHECK(put_file(tensors, metadata, [&](std::span<const std::byte> bytes) { return file.write(bytes); }));
    return file.commit();
}

Status write_safetensors(const Path& path, std::span<const TensorData> tensors,
                         const std::map<std::string, std::string>& metadata)
{
    return stream_safetensors(path, streams_of(tensors), metadata);
}

std::vector<std::byte> encode_safetensors(std::span<const TensorData> tensors,
                                          const std::map<std::string, std::string>& metadata)
{
    std::vector<std::byte> file;
    const Status put = put_file(streams_of(tensors), metadata, [&](std::span<const std::byte> bytes) -> Status {
        file.insert(file.end(), bytes.begin(), bytes.end());
        return {};
    });
    SR_ASSERT(put, "bytes that are in memory");
    return file;
}

Result<std::span<const std::byte>> encode_floats(std::span<const float> values, DType dtype, std::string_view what,
                                                 std::vector<std::byte>& scratch)
{
    scratch.resize(values.size() * dtype_bytes(dtype));
    from_float(values, dtype, scratch.data());
    if (const auto bad = first_non_finite(scratch, dtype))
        return fail(ErrorCode::bad_input, "tensor {} holds {} at element {}, which {} cannot hold", quote(what),
                    values[*bad], *bad, dtype_name(dtype));
    return std::span<const std::byte>(scratch);
}

TensorStream stream_tensor(std::shared_ptr<const SafetensorsSet> set, const TensorInfo& tensor,
                           std::optional<DType> dtype)
{
    const DType target = dtype && is_float(tensor.dtype) ? *dtype : tensor.dtype;
    const auto make = [set = std::move(set), tensor,
                       target](std::vector<std::byte>& scratch) -> Result<std::span<const std::byte>> {
        SR_CHECK(check_finite(*set, tensor));
        const std::span<const std::byte> bytes = set->bytes(tensor);
        if (tensor.dtype == target)
            return bytes;
        std::vector<float> values(tensor.elements());
        to_float(bytes, tensor.dtype, values.data());
        return encode_floats(values, target, tensor.name, scratch);
    };
    return {tensor.name, target, tensor.shape, make};
}

} // namespace semrover
