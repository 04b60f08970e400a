// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "module.h"

// what a variant's file name says, and what its SPIR-V declares
struct Variant {
    std::string name;
    Module module;
};

// Checks the variants of an op against runtime/graph/shader_interface.h, and against each other: the planner takes what
// the first one declares for all. Throws std::runtime_error with what is wrong.
void check_protocol(const std::vector<Variant>& variants);
