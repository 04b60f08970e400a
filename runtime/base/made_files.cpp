// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/made_files.h"

#include "runtime/base/hash.h"

namespace semrover {

namespace {

uint64_t together(std::span<const uint64_t> hashes)
{
    if (hashes.size() == 1)
        return hashes[0];
    Hash all;
    for (const uint64_t& one : hashes)
        all.add(std::as_bytes(std::span(&one, 1)));
    return all.value();
}

} // namespace

Status MadeFiles::add(const Path& path, std::span<const std::byte> bytes)
{
    SR_CHECK(make_folder(path.parent_path()));
    SR_TRY(AtomicFile file, AtomicFile::create(path));
    SR_CHECK(file.write(bytes));
    SR_CHECK(file.flush());
    Hash hash;
    hash.add(bytes);
    files_.push_back(std::move(file));
    hashes_.push_back(hash.value());
    return {};
}

uint64_t MadeFiles::hash() const
{
    return together(hashes_);
}

Status MadeFiles::commit()
{
    for (AtomicFile& file : files_)
        SR_CHECK(file.commit());
    return {};
}

Result<uint64_t> hash_files(std::span<const Path> files)
{
    std::vector<uint64_t> hashes;
    for (const Path& file : files) {
        SR_TRY(hashes.emplace_back(), hash_file(file));
    }
    return together(hashes);
}

} // namespace semrover
