// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/graph/tile_choices.h"

#include "runtime/base/hash.h"
#include "runtime/graph/protocol.h"

#include <charconv>

namespace semrover {

namespace {

bool is_tile(const KernelVariant& variant, uint32_t constant)
{
    for (const std::string_view name :
         {protocol::kTileRows, protocol::kTileCols, protocol::kSubgroups, protocol::kStep, protocol::kThreads})
        if (const ConstantInfo* c = variant.constant(name); c && c->id == constant)
            return true;
    return false;
}

// a number with nothing behind it
template <typename T>
std::optional<T> number(std::string_view text, int base)
{
    T value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
    if (error != std::errc() || end != text.data() + text.size())
        return std::nullopt;
    return value;
}

} // namespace

TileChoices::Key TileChoices::key(const Pass& pass)
{
    Hash hash;
    const auto add = [&](auto value) { hash.add(std::as_bytes(std::span(&value, 1))); };
    hash.add(std::as_bytes(pass.variant->code));
    for (const auto& [id, value] : pass.constants)
        if (!is_tile(*pass.variant, id)) {
            add(id);
            add(value);
        }
    for (const uint32_t size : {pass.grid.x, pass.grid.y, pass.grid.z})
        add(size);
    for (const PassBinding& b : pass.bindings)
        add(b.bytes);
    return hash.value();
}

std::optional<uint32_t> TileChoices::best(Key key) const
{
    const auto found = best_.find(key);
    return found == best_.end() ? std::nullopt : std::optional(found->second);
}

std::string TileChoices::text() const
{
    std::string text;
    for (const auto& [key, tile] : best_)
        text += fmt::format("{:016x} {}\n", key, tile);
    return text;
}

void TileChoices::read(std::string_view text)
{
    for (size_t end = text.find('\n'); end != text.npos; text.remove_prefix(end + 1), end = text.find('\n')) {
        const std::string_view line = text.substr(0, end);
        const size_t space = line.find(' ');
        if (space == line.npos)
            continue;
        const auto key = number<Key>(line.substr(0, space), 16);
        const auto tile = number<uint32_t>(line.substr(space + 1), 10);
        if (key && tile)
            set(*key, *tile);
    }
}

} // namespace semrover
