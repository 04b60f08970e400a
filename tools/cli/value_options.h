// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/dtype.h"
#include "runtime/base/result.h"

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace CLI {
class App;
class Option;
} // namespace CLI

namespace semrover {

// both included
template <typename T>
struct NumberRange {
    T least, most;
};

// Reads a number that is the whole of `text`: decimal, of integers also hexadecimal with 0x in front. For int,
// uint32_t, int64_t, uint64_t, float and double. usage: anything else (an empty text, nan, inf, digits that the type
// does not hold, 1.5 of an integer), and what is outside the range.
template <typename T>
Result<T> parse_number(std::string_view text, NumberRange<T> range);

// An option that takes a number. All options that do are made here: CLI11's own let NaN through range checks, and
// saturate what does not fit. `set` gets the number; of several with commas between them one at a time.
template <typename T>
CLI::Option* add_number_function(CLI::App& command, const std::string& name, std::function<void(T)> set,
                                 const std::string& help, NumberRange<T> range);

template <typename T>
CLI::Option* add_number(CLI::App& command, const std::string& name, T& value, const std::string& help,
                        std::type_identity_t<T> least, std::type_identity_t<T> most)
{
    return add_number_function<T>(command, name, [&value](T number) { value = number; }, help, {least, most});
}

// likewise, none where the option is not given
template <typename T>
CLI::Option* add_number(CLI::App& command, const std::string& name, std::optional<T>& value, const std::string& help,
                        std::type_identity_t<T> least, std::type_identity_t<T> most)
{
    return add_number_function<T>(command, name, [&value](T number) { value = number; }, help, {least, most});
}

// Any of 2^64 keys of random numbers.
template <typename Seed>
CLI::Option* add_seed(CLI::App& command, const std::string& name, Seed& value, const std::string& help)
{
    return add_number(command, name, value, help, uint64_t(0), std::numeric_limits<uint64_t>::max());
}
CLI::Option* add_seeds(CLI::App& command, const std::string& name, std::vector<uint64_t>& values,
                       const std::string& help);

// an option that takes one of these words; `set` gets it
CLI::Option* add_choice(CLI::App& command, const char* name, std::vector<std::string> words, const std::string& help,
                        std::function<void(const std::string&)> set);
CLI::Option* add_choice(CLI::App& command, const char* name, std::vector<std::string> words, const std::string& help,
                        std::string& value);

// --precision: how weights and activations are stored
void add_precision_option(CLI::App& command, DType& precision);

// a class by its name or number, as the value of an option. usage names the option and the classes
Result<uint8_t> class_option(std::string_view option, const std::string& text);

// "6GiB", "500MB", "2.2" (a number below 4096 without a unit: GB), "2200000000" (bytes). K, M, G and T alone or with B
// are powers of 1000, with iB powers of 1024; case does not matter. Errors: usage
Result<uint64_t> parse_memory_size(std::string_view text);

} // namespace semrover
