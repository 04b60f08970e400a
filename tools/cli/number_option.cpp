// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/number_option.h"

#include "runtime/base/quote.h"
#include "tools/cli/option_facts.h"

#include <charconv>
#include <CLI/CLI.hpp>
#include <cmath>

namespace semrover {

namespace {

template <typename T>
bool read_whole(std::string_view text, T& value)
{
    if (text.starts_with('+') && !text.starts_with("+-"))
        text.remove_prefix(1);
    int base = 10;
    if (text.starts_with("0x")) {
        base = 16;
        text.remove_prefix(2);
    }
    const char* const end = text.data() + text.size();
    std::from_chars_result result{};
    if constexpr (std::is_floating_point_v<T>)
        result = base == 10 ? std::from_chars(text.data(), end, value) : std::from_chars_result{};
    else
        result = std::from_chars(text.data(), end, value, base);
    return result.ec == std::errc() && result.ptr == end && !text.empty();
}

template <typename T>
std::string kind_text(const NumberRange<T>& range)
{
    const std::string_view kind = std::is_floating_point_v<T> ? "a number" : "an integer";
    if (range.least == std::numeric_limits<T>::lowest() && range.most == std::numeric_limits<T>::max())
        return fmt::format("{} of {} bits", kind, 8 * sizeof(T));
    return fmt::format("{} from {} to {}", kind, range.least, range.most);
}

// of "-W,--width"
std::string_view longest_name(std::string_view names)
{
    return names.substr(names.rfind(',') + 1);
}

// what CLI11 calls the values of an option, in its help
template <typename T>
void show_range(CLI::Option& option, const NumberRange<T>& range)
{
    const bool number = std::is_floating_point_v<T>;
    const bool whole = range.least == std::numeric_limits<T>::lowest() && range.most == std::numeric_limits<T>::max();
    option.type_name(whole ? "INTEGER"
                           : fmt::format("{} {}..{}", number ? "NUMBER" : "INTEGER", range.least, range.most));
    Json facts = {{"kind", number ? "number" : "integer"}, {"least", range.least}, {"most", range.most}};
    if constexpr (std::is_same_v<T, float>) {
        facts["least"] = short_number(range.least);
        facts["most"] = short_number(range.most);
    }
    set_option_facts(option, std::move(facts));
}

} // namespace

template <typename T>
Result<T> parse_number(std::string_view text, NumberRange<T> range)
{
    T value{};
    // note: NaN is in no range, as all its comparisons are false
    if (!read_whole(text, value) || !(value >= range.least && value <= range.most))
        return fail(ErrorCode::usage, "expected {}, found {}", kind_text(range), quote(text, 60));
    return value;
}

template <typename T>
CLI::Option* add_number_function(CLI::App& command, const std::string& name, std::function<void(T)> set,
                                 const std::string& help, NumberRange<T> range)
{
    const auto read = [set = std::move(set), range, shown = std::string(longest_name(name))](const std::string& text) {
        const Result<T> value = parse_number<T>(text, range);
        if (!value)
            throw CLI::ValidationError(shown, value.error().message);
        set(*value);
    };
    CLI::Option* option = command.add_option_function<std::string>(name, read, help);
    show_range(*option, range);
    return option;
}

CLI::Option* add_seeds(CLI::App& command, const std::string& name, std::vector<uint64_t>& values,
                       const std::string& help)
{
    const NumberRange<uint64_t> range{0, std::numeric_limits<uint64_t>::max()};
    const auto read = [&values, range, shown = std::string(longest_name(name))](const std::vector<std::string>& texts) {
        for (const std::string& text : texts) {
            const auto value = parse_number<uint64_t>(text, range);
            if (!value)
                throw CLI::ValidationError(shown, value.error().message);
            values.push_back(*value);
        }
    };
    CLI::Option* option = command.add_option_function<std::vector<std::string>>(name, read, help);
    option->delimiter(',');
    show_range(*option, range);
    return option;
}

#define SR_NUMBER(T)                                                                                                   \
    template Result<T> parse_number<T>(std::string_view, NumberRange<T>);                                              \
    template CLI::Option* add_number_function<T>(CLI::App&, const std::string&, std::function<void(T)>,                \
                                                 const std::string&, NumberRange<T>);
SR_NUMBER(int)
SR_NUMBER(uint32_t)
SR_NUMBER(int64_t)
SR_NUMBER(uint64_t)
SR_NUMBER(float)
SR_NUMBER(double)
#undef SR_NUMBER

} // namespace semrover
