// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/print_stderr.h"

#include <algorithm>

namespace semrover {

namespace {

struct FieldOption {
    std::string_view field, option;
};

// fields whose options have other names; every other `some_field` is --some-field
constexpr FieldOption kFieldOptions[] = {
    {"asd_init", "semrover convert IN OUT --asd-init"},
    {"calibration", "--calib"},
    {"default_label", "--label"},
    {"depth.kind", "--depth-kind"},
    {"depth.unit", "--depth-scale"},
    {"format", "--from"},
    {"height", "-H"},
    {"lidar_to_camera", "--calib"},
    {"max_bytes", "--max-vram"},
    {"output", "-o"},
    {"replace", "-y"},
    {"voxel", "--tsdf-voxel"},
    {"vsd_init", "semrover convert IN OUT --vsd-init"},
    {"width", "-W"},
};

bool names_field(std::string_view word)
{
    return !word.empty() && word.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_.") == word.npos;
}

} // namespace

std::string option_of(std::string_view field)
{
    const auto* const other = std::ranges::find(kFieldOptions, field, &FieldOption::field);
    if (other != std::end(kFieldOptions))
        return std::string(other->option);
    std::string option = "--" + std::string(field);
    std::ranges::replace(option, '_', '-');
    return option;
}

std::string with_options(std::string_view message)
{
    std::string text;
    for (size_t begin = 0; begin < message.size();) {
        const size_t open = std::min(message.find('`', begin), message.size());
        const size_t close = open < message.size() ? message.find('`', open + 1) : message.npos;
        text += message.substr(begin, open - begin);
        const std::string_view word = close == message.npos ? "" : message.substr(open + 1, close - open - 1);
        begin = names_field(word) ? close + 1 : open + 1;
        if (names_field(word))
            text += option_of(word);
        else
            text += message.substr(open, 1);
    }
    return text;
}

void print_warnings(const std::vector<std::string>& warnings, const Globals& globals)
{
    for (const std::string& warning : warnings)
        if (!globals.quiet)
            print_stderr("semrover: warning: {}\n", warning);
}

} // namespace semrover
