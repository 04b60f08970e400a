// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/safetensors.h"

#include "runtime/base/quote.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace semrover {

static_assert(std::endian::native == std::endian::little, "tensor data is used as it lies in the file");

namespace {

template <typename T>
const T* find_by_name(const std::vector<T>& sorted, std::string_view name)
{
    const auto found =
        std::ranges::lower_bound(sorted, name, {}, [](const T& t) -> std::string_view { return t.name; });
    return found != sorted.end() && found->name == name ? &*found : nullptr;
}

Result<const TensorInfo*> get_by_name(const std::vector<TensorInfo>& tensors,
                                      const std::vector<UnsupportedTensor>& unsupported, std::string_view name,
                                      const Path& path)
{
    if (const TensorInfo* tensor = find_by_name(tensors, name))
        return tensor;
    if (const UnsupportedTensor* tensor = find_by_name(unsupported, name))
        return fail(ErrorCode::bad_input, "{}: tensor {} has dtype {}, which is not supported", quote_path(path),
                    quote(name), quote(tensor->dtype));
    return fail(ErrorCode::bad_input, "{}: there is no tensor {}", quote_path(path), quote(name));
}

// one list of an error that names many tensors; the end is cut off where no one would read on
class Listing {
  public:
    explicit Listing(std::string title) : title_(std::move(title)) {}

    void add(std::string item)
    {
        if (++count_ <= kShown)
            items_.push_back(std::move(item));
    }

    void append_to(std::string& message) const
    {
        if (count_ == 0)
            return;
        message += fmt::format("; {} {}: {}", count_, title_, fmt::join(items_, ", "));
        if (count_ > kShown)
            message += fmt::format(" and {} more", count_ - kShown);
    }

  private:
    static constexpr size_t kShown = 1000;

    std::string title_;
    std::vector<std::string> items_;
    size_t count_ = 0;
};

} // namespace

Result<Safetensors> Safetensors::open(const Path& path, const SafetensorsLimits& limits)
{
    Safetensors result;
    result.path_ = path;
    SR_TRY(result.file_, MappedFile::open(path));
    SR_TRY(result.header_, parse_safetensors_header(result.file_.bytes(), quote_path(path), limits));
    return result;
}

const TensorInfo* Safetensors::find(std::string_view name) const
{
    return find_by_name(header_.tensors, name);
}

Result<const TensorInfo*> Safetensors::get(std::string_view name) const
{
    return get_by_name(header_.tensors, header_.unsupported, name, path_);
}

const TensorInfo* SafetensorsSet::find(std::string_view name) const
{
    return find_by_name(tensors_, name);
}

Result<const TensorInfo*> SafetensorsSet::get(std::string_view name) const
{
    return get_by_name(tensors_, unsupported_, name, path_);
}

Status SafetensorsSet::require(std::span<const TensorSpec> schema, Unexpected unexpected, std::string_view prefix) const
{
    Listing missing("missing"), misshapen("misshapen"), mistyped("of an unsupported dtype"), extra("unexpected");
    std::vector<std::string_view> known;
    known.reserve(schema.size());
    for (const TensorSpec& spec : schema) {
        known.push_back(spec.name);
        const TensorInfo* tensor = find(spec.name);
        if (const UnsupportedTensor* other = find_by_name(unsupported_, spec.name)) {
            mistyped.add(fmt::format("{} ({})", printable(spec.name), printable(other->dtype)));
        } else if (!tensor) {
            if (!spec.optional)
                missing.add(fmt::format("{} {}", printable(spec.name), shape_text(spec.shape)));
        } else if (tensor->shape != spec.shape) {
            misshapen.add(fmt::format("{} expected {} found {}", printable(spec.name), shape_text(spec.shape),
                                      shape_text(tensor->shape)));
        } else if (std::ranges::find(spec.dtypes, tensor->dtype) == spec.dtypes.end()) {
            const std::string found = dtype_name(tensor->dtype);
            mistyped.add(printable(spec.name) +
                         (spec.dtypes.size() == 1
                              ? fmt::format(" expected {} found {}", dtype_name(spec.dtypes[0]), found)
                              : fmt::format(" ({})", found)));
        }
    }
    std::ranges::sort(known);
    const auto list_extra = [&](const auto& tensor) {
        if (tensor.name.starts_with(prefix) && !std::ranges::binary_search(known, std::string_view(tensor.name)))
            extra.add(fmt::format("{} {}", printable(tensor.name), shape_text(tensor.shape)));
    };
    if (unexpected == Unexpected::refuse) {
        std::ranges::for_each(tensors_, list_extra);
        std::ranges::for_each(unsupported_, list_extra);
    }
    std::string lists;
    for (const Listing* listing : {&missing, &misshapen, &mistyped, &extra})
        listing->append_to(lists);
    if (lists.empty())
        return {};
    return fail(ErrorCode::bad_input, "{}: tensors do not fit the model{}", quote_path(path_), lists);
}

Status check_finite(const SafetensorsSet& set, const TensorInfo& tensor)
{
    if (const auto index = first_non_finite(set.bytes(tensor), tensor.dtype))
        return fail(ErrorCode::bad_input, "{}: tensor {} holds NaN or infinity, first at element {} of {}",
                    quote_path(set.path()), quote(tensor.name), *index, tensor.elements());
    return {};
}

Status check_finite(const SafetensorsSet& set)
{
    for (const TensorInfo& tensor : set.tensors())
        SR_CHECK(check_finite(set, tensor));
    return {};
}

} // namespace semrover
