// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/weight_loader.h"

#include "engine/model/weight_blocks.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>

namespace semrover {

namespace {

// a row of a tensor that goes to a row of a weight
struct Piece {
    uint32_t to, part, from;
};

std::vector<Piece> pieces_of(const WeightLayout& w)
{
    std::vector<Piece> pieces;
    for (uint32_t p = 0; p < w.parts.size(); ++p)
        for (const IndexRange& run : w.parts[p].rows)
            for (uint32_t i = 0; i < run.count; ++i)
                pieces.push_back({run.to + i, p, run.from + i});
    std::ranges::stable_sort(pieces, {}, &Piece::to);
    return pieces;
}

float share_of(float mix_factor, bool switched)
{
    const double alpha = 1 / (1 + std::exp(-double(mix_factor)));
    return float(switched ? alpha : 1 - alpha);
}

// a part, and what its tensor holds
struct Opened {
    const WeightPart* part = nullptr;
    TensorValues values;
    std::vector<float> scratch; // that `values` may lie in
    float share = 1;
    WeightPart blocks;   // of a weight in blocks: where the part's blocks go, one by one
    TensorValues scales; // of such a file

    uint32_t elements() const { return part->cols_of_row * part->taps; } // of a row
    std::span<const std::byte> row(uint32_t r, uint32_t count = 1) const
    {
        const size_t bytes = elements() * dtype_bytes(values.dtype);
        return values.bytes.subspan(r * bytes, count * bytes);
    }
    bool scaled() const { return part->gain != 1 || share != 1; }
    bool converts(DType to) const { return values.dtype != to || scaled(); }
    // are its rows those of the weight, byte for byte?
    bool lies_as(const DeviceTensor& weight) const
    {
        return !converts(weight.dtype()) && part->taps == 1 && part->cols.size() == 1 && part->cols[0].to == 0 &&
               part->cols[0].count == weight.ld();
    }
};

// ranges that follow each other on both sides as one
IndexRanges joined(const IndexRanges& runs)
{
    IndexRanges all;
    for (const IndexRange& run : runs)
        if (!all.empty() && all.back().from + all.back().count == run.from &&
            all.back().to + all.back().count == run.to)
            all.back().count += run.count;
        else
            all.push_back(run);
    return all;
}

// a part whose columns are blocks
WeightPart in_blocks(WeightPart p)
{
    constexpr uint32_t kBlock = block_of(DType::q8_0).elements;
    const auto whole = [&](uint32_t n) {
        SR_ASSERT(n % kBlock == 0, "'{}' does not lie in whole blocks", p.spec.name);
        return n / kBlock;
    };
    p.cols_of_row = whole(p.cols_of_row);
    p.tap_width = whole(p.tap_width);
    p.cols = joined(p.cols);
    for (IndexRange& run : p.cols)
        run = {whole(run.from), whole(run.to), whole(run.count)};
    return p;
}

// elements of a row, [cols, taps], to where they go
template <typename Word>
void scatter(const WeightPart& p, const std::byte* from, std::byte* to)
{
    for (const IndexRange& run : p.cols) {
        if (p.taps == 1) {
            std::memcpy(to + run.to * sizeof(Word), from + run.from * sizeof(Word), run.count * sizeof(Word));
            continue;
        }
        for (uint32_t tap = 0; tap < p.taps; ++tap) {
            const std::byte* source = from + (size_t(run.from) * p.taps + tap) * sizeof(Word);
            std::byte* target = to + (size_t(tap) * p.tap_width + run.to) * sizeof(Word);
            for (uint32_t i = 0; i < run.count; ++i)
                std::memcpy(target + i * sizeof(Word), source + size_t(i) * p.taps * sizeof(Word), sizeof(Word));
        }
    }
}

class Packer {
  public:
    Packer(Device& device, const TensorSource& source) : device_(device), source_(source) {}
    ~Packer() { device_.drop_writes(); } // after an error
    Packer(const Packer&) = delete;
    Packer& operator=(const Packer&) = delete;

    Status pack(const WeightLayout& w)
    {
        SR_CHECK(open(w));
        const std::vector<Piece> pieces = pieces_of(w);
        SR_ASSERT(!pieces.empty() && pieces.back().to < w.weight.rows(), "rows beyond those of '{}'", w.weight.name());
        const DeviceTensor& weight = w.weight;
        const uint64_t row_bytes = row_bytes_of(weight.dtype(), weight.ld());
        const uint32_t at_once = uint32_t(std::max<uint64_t>(device_.most_room() / row_bytes, 1));
        auto next = pieces.begin();
        for (uint32_t first = 0; first < weight.rows(); first += at_once) {
            const uint32_t count = std::min(at_once, weight.rows() - first);
            const BufferSlice slice = weight.slice().part(first * row_bytes, count * row_bytes);
            SR_TRY(const std::span<std::byte> room, device_.room(slice));
            const auto end = std::find_if(next, pieces.end(), [&](const Piece& p) { return p.to >= first + count; });
            SR_CHECK(pack_rows(weight, {next, end}, first, room));
            next = end;
        }
        return {};
    }

  private:
    Status open(const WeightLayout& w)
    {
        opened_.resize(std::max(opened_.size(), w.parts.size()));
        for (size_t i = 0; i < w.parts.size(); ++i) {
            Opened& o = opened_[i];
            o.part = &w.parts[i];
            o.share = 1;
            if (o.part->spec.name.empty()) {
                o.scratch.assign(1, 1.f);
                o.values = {std::as_bytes(std::span(o.scratch)), DType::f32};
            } else {
                SR_TRY(o.values, source_(o.part->spec, o.scratch));
            }
            if (w.weight.dtype() == DType::q8_0)
                SR_CHECK(open_blocks(o));
            if (!o.part->share)
                continue;
            std::vector<float> scratch;
            SR_TRY(const TensorValues mix, source_({o.part->share->mix_factor, {1}}, scratch));
            float value = 0;
            to_float(mix.bytes, mix.dtype, &value);
            SR_CHECK(check(mix.bytes, mix, 0));
            o.share = share_of(value, o.part->share->switched);
        }
        return {};
    }

    Status open_blocks(Opened& o) const
    {
        o.blocks = in_blocks(*o.part);
        std::vector<float> none; // numbers that are computed have no scales
        if (o.values.dtype == DType::i8) {
            SR_TRY(o.scales, source_(scales_of(o.part->spec), none));
        }
        return {};
    }

    Status pack_rows(const DeviceTensor& weight, std::span<const Piece> pieces, uint32_t first,
                     std::span<std::byte> room)
    {
        const uint64_t row_bytes = row_bytes_of(weight.dtype(), weight.ld());
        uint32_t done = first; // rows that are packed or empty
        for (size_t i = 0; i < pieces.size();) {
            const Opened& o = opened_[pieces[i].part];
            size_t count = 1; // pieces that lie as they go
            while (o.lies_as(weight) && i + count < pieces.size() && follows(pieces[i + count - 1], pieces[i + count]))
                ++count;
            std::byte* to = room.data() + (pieces[i].to - first) * row_bytes;
            const std::span<const std::byte> from = o.row(pieces[i].from, uint32_t(count));
            if (o.lies_as(weight)) {
                SR_CHECK(check(from, o.values, uint64_t(pieces[i].from) * o.elements()));
                clear(room, (done - first) * row_bytes, (pieces[i].to - first) * row_bytes);
                std::memcpy(to, from.data(), from.size());
            } else {
                clear(room, (done - first) * row_bytes, (pieces[i].to + 1 - first) * row_bytes);
                SR_CHECK(weight.dtype() == DType::q8_0 ? pack_blocks(weight, o, pieces[i], to)
                                                       : pack_row(weight, o, pieces[i], to));
            }
            done = pieces[i].to + uint32_t(count);
            i += count;
        }
        clear(room, (done - first) * row_bytes, room.size());
        return {};
    }

    static bool follows(const Piece& a, const Piece& b)
    {
        return b.part == a.part && b.to == a.to + 1 && b.from == a.from + 1;
    }

    static void clear(std::span<std::byte> room, uint64_t begin, uint64_t end)
    {
        if (begin < end)
            std::memset(room.data() + begin, 0, end - begin);
    }

    // a part's numbers, in words_, as another type or multiplied; element: the number of the first one in the tensor
    Status convert(const Opened& o, const TensorValues& values, std::span<const std::byte> row, uint64_t element,
                   DType dtype)
    {
        read_numbers(o, values, row);
        words_.resize(numbers_.size() * dtype_bytes(dtype));
        from_float(numbers_, dtype, words_.data());
        if (!first_non_finite(words_, dtype))
            return {};
        SR_CHECK(check(row, values, element));
        return too_large(o, dtype);
    }

    void read_numbers(const Opened& o, const TensorValues& values, std::span<const std::byte> row)
    {
        numbers_.resize(row.size() / dtype_bytes(values.dtype));
        to_float(row, values.dtype, numbers_.data());
        for (float& v : numbers_)
            v = o.part->gain * (v * o.share);
    }

    // int8 and, behind the row's last, the scales of its blocks
    Status pack_blocks(const DeviceTensor& weight, const Opened& o, const Piece& piece, std::byte* to)
    {
        const uint64_t element = uint64_t(piece.from) * o.elements();
        std::span<const std::byte> row = o.row(piece.from), scales;
        if (o.values.dtype == DType::i8) {
            const size_t bytes = o.elements() / block_of(DType::q8_0).elements * 2;
            scales = o.scales.bytes.subspan(piece.from * bytes, bytes);
            SR_CHECK(check(scales, o.scales, piece.from * bytes / 2));
            if (o.scaled()) {
                SR_CHECK(convert(o, o.scales, scales, piece.from * bytes / 2, DType::f16));
                scales = words_;
            }
        } else {
            SR_CHECK(check(row, o.values, element));
            read_numbers(o, o.values, row);
            to_blocks(numbers_, o.part->cols_of_row, o.part->taps, blocks_);
            row = std::as_bytes(std::span(blocks_.values));
            scales = std::as_bytes(std::span(blocks_.scales));
            if (first_non_finite(scales, DType::f16))
                return too_large(o, DType::q8_0);
        }
        scatter<uint8_t>(*o.part, row.data(), to);
        scatter<uint16_t>(o.blocks, scales.data(), to + weight.ld());
        return {};
    }

    Status pack_row(const DeviceTensor& weight, const Opened& o, const Piece& piece, std::byte* to)
    {
        const DType dtype = weight.dtype();
        std::span<const std::byte> row = o.row(piece.from);
        const uint64_t element = uint64_t(piece.from) * o.elements();
        if (o.converts(dtype)) {
            SR_CHECK(convert(o, o.values, row, element, dtype));
            row = words_;
        } else {
            SR_CHECK(check(row, o.values, element));
        }
        if (dtype_bytes(dtype) == 2)
            scatter<uint16_t>(*o.part, row.data(), to);
        else
            scatter<uint32_t>(*o.part, row.data(), to);
        return {};
    }

    // element: the number of the first one in the tensor
    static Status check(std::span<const std::byte> bytes, const TensorValues& values, uint64_t element)
    {
        const auto bad = first_non_finite(bytes, values.dtype);
        if (!bad)
            return {};
        return fail(ErrorCode::bad_input, "{}: tensor {} holds NaN or infinity, first at element {} of {}",
                    quote_path(values.file), quote(values.name), element + *bad,
                    values.bytes.size() / dtype_bytes(values.dtype));
    }

    tl::unexpected<Error> too_large(const Opened& o, DType dtype) const
    {
        const auto largest = std::ranges::max_element(numbers_, {}, [](float v) { return std::abs(v); });
        return fail(ErrorCode::bad_input, "tensor '{}' holds {}, which {} cannot hold: use `precision` fp32",
                    o.part->spec.name, *largest, dtype_name(dtype));
    }

    Device& device_;
    const TensorSource& source_;
    std::vector<Opened> opened_; // kept from weight to weight: new memory costs more than what is written to it
    std::vector<float> numbers_;
    std::vector<std::byte> words_;
    WeightBlocks blocks_;
};

} // namespace

IndexRanges straight(uint32_t count, uint32_t to)
{
    return {{0, to, count}};
}

IndexRanges of_heads(uint32_t count, uint32_t heads, uint32_t to)
{
    if (!heads)
        return straight(count, to);
    IndexRanges runs;
    const uint32_t size = count / heads, padded = round_up(size, kRowPadding);
    if (size == padded)
        return straight(count, to);
    for (uint32_t h = 0; h < heads; ++h)
        runs.push_back({h * size, to + h * padded, size});
    return runs;
}

IndexRanges interleaved(uint32_t count, uint32_t to)
{
    constexpr uint32_t kBlock = 8;
    IndexRanges runs;
    const uint32_t half = count / 2;
    for (uint32_t first = 0; first < half; first += kBlock)
        for (const uint32_t gate : {0u, 1u})
            runs.push_back({gate * half + first, to + 2 * first + gate * kBlock, std::min(kBlock, half - first)});
    return runs;
}

Status load_weights(Device& device, std::span<const WeightLayout> weights, const TensorSource& source,
                    const LoadProgress& progress)
{
    Packer packer(device, source);
    for (const WeightLayout& w : weights) {
        SR_CHECK(packer.pack(w));
        if (progress)
            SR_CHECK(progress(w.weight.bytes()));
    }
    return device.finish_writes();
}

std::vector<TensorSpec> schema_of(std::span<const WeightLayout> weights)
{
    std::map<std::string, TensorSpec> specs;
    for (const WeightLayout& w : weights)
        for (const WeightPart& part : w.parts) {
            if (!part.spec.name.empty())
                specs[part.spec.name] = part.spec;
            if (part.share)
                specs[part.share->mix_factor] = {part.share->mix_factor, {1}};
        }
    std::vector<TensorSpec> schema;
    for (auto& [name, spec] : specs)
        schema.push_back(std::move(spec));
    return schema;
}

uint64_t parameters_of(std::span<const WeightLayout> weights)
{
    uint64_t sum = 0;
    for (const TensorSpec& spec : schema_of(weights)) {
        uint64_t size = 1;
        for (const uint64_t n : spec.shape)
            size *= n;
        sum += size;
    }
    return sum;
}

} // namespace semrover
