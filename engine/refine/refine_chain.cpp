// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/refine_chain.h"

#include "runtime/base/hash.h"

namespace semrover {

uint32_t chain_key(const std::string& camera)
{
    if (camera.empty())
        return 0;
    Hash hash;
    hash.add(camera);
    return uint32_t(hash.value());
}

} // namespace semrover
