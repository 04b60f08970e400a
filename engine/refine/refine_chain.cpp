// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/refine_chain.h"

#include "runtime/base/hash.h"

#include <algorithm>

namespace semrover {

namespace {

// frames that a decoder of videos sees before those that are kept
constexpr uint32_t kDecodeOverlap = 1;

} // namespace

std::vector<FrameWindow> decode_windows(const RefineChain& chain, const FrameWindow& window)
{
    const uint32_t length = chain.shape.decode_frames, overlap = std::min(kDecodeOverlap, length - 1);
    return frame_windows({window.next(), window.end() - 1}, window.known, length, overlap);
}

uint32_t chain_key(const std::string& camera)
{
    if (camera.empty())
        return 0;
    Hash hash;
    hash.add(camera);
    return uint32_t(hash.value());
}

} // namespace semrover
