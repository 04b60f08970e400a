// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// starts[b] = how many of the sorted keys are below b
#include "kernels/sort.h"

#include "bucket_starts.spv.h"

namespace semrover {

Tensor bucket_starts(Graph& g, Tensor keys, uint32_t buckets, Tensor count)
{
    SR_ASSERT(keys.dtype == DType::u32 && keys.ld == 1, "bucket_starts: keys [{}, {}]", keys.rows, keys.cols);
    const Tensor starts = g.array(buckets + 1, DType::u32, "bucket starts");
    DispatchOptions options;
    options.constants = {{"kCounted", count.valid()}};
    g.dispatch(kernel::bucket_starts, {{"Keys", keys}, {"Count", count}, {"Starts", starts}},
               BucketStartsPush{.size = keys.rows, .buckets = buckets}, threads(buckets + 1), std::move(options));
    return starts;
}

} // namespace semrover
