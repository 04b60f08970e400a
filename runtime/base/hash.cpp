// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/hash.h"

#include <algorithm>
#include <fmt/format.h>
#include <new>
#include <xxhash.h>

namespace semrover {

struct Hash::State {
    XXH64_state_t* xxh = XXH64_createState();
    State()
    {
        if (!xxh)
            throw std::bad_alloc();
    }
    ~State() { XXH64_freeState(xxh); }
};

Hash::Hash() : state_(std::make_unique<State>())
{
    XXH64_reset(state_->xxh, 0);
}
Hash::~Hash() = default;

void Hash::add(std::span<const std::byte> bytes)
{
    const uint64_t size = bytes.size();
    XXH64_update(state_->xxh, &size, sizeof size);
    if (size)
        XXH64_update(state_->xxh, bytes.data(), bytes.size());
}

Status Hash::add_file(const Path& path)
{
    return read_in_pieces(
        path, [&](uint64_t size) { XXH64_update(state_->xxh, &size, sizeof size); },
        [&](std::span<const std::byte> bytes) {
            if (!bytes.empty())
                XXH64_update(state_->xxh, bytes.data(), bytes.size());
        });
}

uint64_t Hash::value() const
{
    return XXH64_digest(state_->xxh);
}

Result<uint64_t> hash_file(const Path& path)
{
    Hash hash;
    SR_CHECK(hash.add_file(path));
    return hash.value();
}

Result<uint64_t> hash_folder(const Path& folder)
{
    SR_TRY(const std::vector<Path> files, list_files(folder));
    Hash hash;
    for (const Path& path : files) {
        hash.add(path.filename().string());
        SR_CHECK(hash.add_file(path));
    }
    return hash.value();
}

std::string hash_text(uint64_t hash)
{
    return fmt::format("{:016x}", hash);
}

} // namespace semrover
