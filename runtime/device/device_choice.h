// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/device.h"

namespace semrover {

// a variable's value, or null: as std::getenv
using Environment = std::function<const char*(const char* name)>;

// The index of the device that `select` means, of all there are:
//   ""      the first that can be used
//   "auto"  The only GPU. Of several, the only one that all of SLURM_JOB_GPUS, SLURM_STEP_GPUS, CUDA_VISIBLE_DEVICES,
//           ROCR_VISIBLE_DEVICES and HIP_VISIBLE_DEVICES name, which Vulkan's drivers do not read: by index in the
//           order of PCI addresses, by UUID or its beginning (GPU-...), or by PCI address. An empty one names none.
//           Without a GPU: the first other device.
//   else    an index, a UUID, a PCI address, or a part of a name
// With `require_gpu` a CPU is an error.
// Errors: no_device, with what there is.
Result<uint32_t> choose_device(const std::vector<DeviceSummary>& all, const std::string& select, bool require_gpu,
                               const Environment& environment);

// whether a batch system or a cluster started this process, on a machine that it may share with others
bool is_under_engine(const Environment& environment);

} // namespace semrover
