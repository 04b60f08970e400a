// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

// what the engine needs to know of one SPIR-V module
struct Binding {
    std::string name;
    uint32_t binding = 0;
    bool texel = false;
    bool readable = true, writable = true;
};

struct Constant {
    std::string name;
    uint32_t id = 0, value = 0;
    bool is_bool = false;
};

struct Member {
    std::string name;
    std::string type; // in C++
    uint32_t offset = 0;
};

struct Module {
    std::vector<uint32_t> code;
    std::vector<Binding> bindings; // sorted by binding
    std::vector<Constant> constants;
    std::string push_name;
    std::vector<Member> push;
    uint32_t push_bytes = 0;
    uint32_t local_size[3] = {1, 1, 1};
    std::string shared_bytes = "0u"; // as C++: of c, the constants' values in the order above
    uint32_t features = 0;           // KernelFeatures of runtime/graph/kernel.h
};

// throws std::runtime_error with a message that names what is wrong (a build-time tool)
Module reflect(std::vector<uint32_t> code);
