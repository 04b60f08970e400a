// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/scratch_folder.h"

#include <fstream>
#include <iterator>
#include <random>

namespace semrover {

ScratchFolder::ScratchFolder()
{
    std::random_device random;
    do
        path_ = std::filesystem::temp_directory_path() / ("semrover-test-" + std::to_string(random()));
    while (!std::filesystem::create_directory(path_));
}

ScratchFolder::~ScratchFolder()
{
    std::filesystem::remove_all(path_);
}

std::filesystem::path ScratchFolder::put(std::string_view name, std::string_view text) const
{
    std::filesystem::path file = path_ / name;
    std::ofstream(file, std::ios::binary).write(text.data(), static_cast<std::streamsize>(text.size()));
    return file;
}

bool ScratchFolder::link([[maybe_unused]] std::string_view name,
                         [[maybe_unused]] const std::filesystem::path& target) const
{
#ifndef _WIN32
    std::filesystem::create_symlink(target, path_ / name);
    return true;
#endif
    return false;
}

size_t ScratchFolder::entries() const
{
    using Iterator = std::filesystem::directory_iterator;
    return static_cast<size_t>(std::distance(Iterator(path_), Iterator()));
}

std::string contents(const std::filesystem::path& path)
{
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

} // namespace semrover
