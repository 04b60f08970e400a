// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/golden_tensors.h"

#include <fstream>
#include <iterator>

namespace semrover {

GoldenTensors::GoldenTensors(const std::string& name)
{
    const std::string folder = std::string(SEMROVER_SOURCE_DIR) + "/tests/golden/" + name;
    params = nlohmann::json::parse(std::ifstream(folder + "/case.json")).at("params");
    std::ifstream file(folder + "/tensors.safetensors", std::ios::binary);
    const std::string all{std::istreambuf_iterator<char>(file), {}};
    uint64_t length = 0;
    std::memcpy(&length, all.data(), sizeof(length));
    header = nlohmann::json::parse(all.substr(8, length));
    data = all.substr(8 + length);
}

} // namespace semrover
