// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/scratch_folder.h"

#include <cstdlib>
#include <fstream>
#include <functional>
#include <iterator>
#include <random>

namespace semrover {

namespace {

namespace fs = std::filesystem;

// With $SEMROVER_TEST_INPUTS, a folder, what tests write stays there under a name of its content: where tests/fuzz
// begins
class KeptInputs {
  public:
    static constexpr size_t kMostBytes = 64 << 10;

    void file(const fs::path& name, const std::string& bytes) const
    {
        if (!folder_ || bytes.size() > kMostBytes || name.string().size() > 100)
            return;
        const fs::path kept =
            fs::path(folder_) / (std::to_string(std::hash<std::string>()(bytes)) + "-" + name.string());
        if (!fs::exists(kept))
            std::ofstream(kept, std::ios::binary) << bytes;
    }

    // each of its files, and all as one, as tests/fuzz/fuzz_target.h has folders
    void tree(const fs::path& path) const
    {
        if (!folder_)
            return;
        std::string all;
        for (const auto& entry : fs::recursive_directory_iterator(path)) {
            std::error_code ignored;
            if (!entry.is_regular_file(ignored) || entry.is_symlink() || entry.file_size(ignored) > kMostBytes)
                continue;
            const std::string bytes = contents(entry.path());
            file(entry.path().filename(), bytes);
            all += (all.empty() ? "@@@ " : "\n@@@ ") + entry.path().lexically_relative(path).generic_string() + "\n" +
                   bytes;
        }
        if (!all.empty())
            file("all.folder", all);
    }

  private:
    const char* folder_ = std::getenv("SEMROVER_TEST_INPUTS");
};

} // namespace

ScratchFolder::ScratchFolder()
{
    std::random_device random;
    do
        path_ = std::filesystem::temp_directory_path() / ("semrover-test-" + std::to_string(random()));
    while (!std::filesystem::create_directory(path_));
}

ScratchFolder::~ScratchFolder()
{
    KeptInputs().tree(path_);
    std::filesystem::remove_all(path_);
}

std::filesystem::path ScratchFolder::put(std::string_view name, std::string_view text) const
{
    std::filesystem::path file = path_ / name;
    KeptInputs().file(file.filename(), std::string(text));
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
