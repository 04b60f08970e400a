// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/pass.h"

#include <span>

namespace semrover {

// bytes of shared memory that a variant takes with these constants, of those that it has; others have their defaults
uint32_t shared_bytes(const KernelVariant& variant, std::span<const ConstantValue> constants);

// does a variant read and write elements of this type at its binding of that index?
bool takes(const Kernel& kernel, const KernelVariant& variant, size_t binding, DType type);

// The variant of `kernel` for a device, among those its limits allow with these constants and tensors (none: fp16
// ones), but for those that need what is excluded: the forced one, else cpu, coopmat or simt by device type. nullptr:
// none runs on it.
const KernelVariant* choose_variant(const Kernel& kernel, const DeviceLimits& limits,
                                    std::span<const ConstantValue> constants = {}, std::span<const Tensor> tensors = {},
                                    uint32_t excluded = 0);

} // namespace semrover
