// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/hash.h"

#include <algorithm>
#include <fmt/format.h>
#include <xxhash.h>

namespace semrover {

struct Hash::State {
    XXH64_state_t* xxh = XXH64_createState();
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

uint64_t Hash::value() const
{
    return XXH64_digest(state_->xxh);
}

Result<uint64_t> hash_file(const Path& path)
{
    SR_TRY(const MappedFile file, MappedFile::open(path));
    Hash hash;
    hash.add(file.bytes());
    return hash.value();
}

Result<uint64_t> hash_folder(const Path& folder)
{
    SR_TRY(const std::vector<Path> files, list_files(folder));
    Hash hash;
    for (const Path& path : files) {
        SR_TRY(const MappedFile file, MappedFile::open(path));
        hash.add(path.filename().string());
        hash.add(file.bytes());
    }
    return hash.value();
}

std::string hash_text(uint64_t hash)
{
    return fmt::format("{:016x}", hash);
}

} // namespace semrover
