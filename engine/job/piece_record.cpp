// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/piece_record.h"

#include "runtime/base/hash.h"
#include "runtime/base/inner_path.h"

namespace semrover {

PieceRecord::PieceRecord(RunFolder& run, const FilesOf& files) : run_(run)
{
    for (const Json& entry : run.entries()) {
        if (!entry.is_object() || !entry.value("piece", Json()).is_string())
            continue;
        const std::string piece = entry["piece"];
        if (!leads_inside(piece)) // of a journal that somebody else wrote
            continue;
        const auto now = hash_files(files(piece));
        done_[piece] = now && entry.value("xxh64", Json()) == hash_text(*now);
    }
}

bool PieceRecord::has(const std::string& piece) const
{
    const auto found = done_.find(piece);
    return found != done_.end() && found->second;
}

Status PieceRecord::add(const std::string& piece, MadeFiles& files, const Json& more)
{
    SR_CHECK(files.commit());
    Json entry{{"piece", piece}, {"xxh64", hash_text(files.hash())}};
    entry.update(more);
    SR_CHECK(run_.append(entry));
    done_[piece] = true;
    return {};
}

} // namespace semrover
