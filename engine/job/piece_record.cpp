// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/piece_record.h"

#include "runtime/base/hash.h"

namespace semrover {

PieceRecord::PieceRecord(RunFolder& run, FilesOf files) : run_(run), files_(std::move(files))
{
    for (const Json& entry : run.entries()) {
        if (!entry.is_object() || !entry.value("piece", Json()).is_string())
            continue;
        const std::string piece = entry["piece"];
        const auto now = hash(piece);
        done_[piece] = now && entry.value("xxh64", Json()) == hash_text(*now);
    }
}

bool PieceRecord::has(const std::string& piece) const
{
    const auto found = done_.find(piece);
    return found != done_.end() && found->second;
}

Status PieceRecord::add(const std::string& piece)
{
    SR_TRY(const uint64_t now, hash(piece));
    SR_CHECK(run_.append({{"piece", piece}, {"xxh64", hash_text(now)}}));
    done_[piece] = true;
    return {};
}

Result<uint64_t> PieceRecord::hash(const std::string& piece) const
{
    const std::vector<Path> files = files_(piece);
    if (files.size() == 1)
        return hash_file(files[0]);
    Hash all;
    for (const Path& file : files) {
        SR_TRY(const uint64_t one, hash_file(file));
        all.add(std::as_bytes(std::span(&one, 1)));
    }
    return all.value();
}

} // namespace semrover
