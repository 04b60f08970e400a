// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/value_options.h"

#include "runtime/base/quote.h"
#include "tools/cli/option_facts.h"
#include "tools/editing/cell_selection.h"

#include <algorithm>
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

constexpr double kGigabytesBelow = 4096; // nobody means so few bytes

// bytes of a unit; 0 for one that is not known
double unit_bytes(std::string_view unit)
{
    constexpr std::string_view kPrefixes = "kmgt";
    std::string u(unit);
    std::ranges::transform(u, u.begin(), [](unsigned char c) { return char(std::tolower(c)); });
    if (u == "b")
        return 1;
    const size_t power = u.empty() ? std::string_view::npos : kPrefixes.find(u[0]);
    if (power == std::string_view::npos)
        return 0;
    const std::string_view rest = std::string_view(u).substr(1);
    if (rest == "ib")
        return std::pow(1024., double(power + 1));
    return rest.empty() || rest == "b" ? std::pow(1000., double(power + 1)) : 0;
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

CLI::Option* add_choice(CLI::App& c, const char* name, std::vector<std::string> words, const std::string& help,
                        std::function<void(const std::string&)> set)
{
    CLI::Option* option = c.add_option_function<std::string>(name, std::move(set), help);
    set_option_facts(*option, {{"kind", "choice"}, {"words", words}});
    return option->check(CLI::IsMember(std::move(words)));
}

CLI::Option* add_choice(CLI::App& c, const char* name, std::vector<std::string> words, const std::string& help,
                        std::string& value)
{
    return add_choice(c, name, std::move(words), help, [&value](const std::string& word) { value = word; });
}

void add_precision_option(CLI::App& c, DType& precision)
{
    add_choice(c, "--precision", {"fp16", "fp32"}, "storage of weights and activations",
               [&precision](const std::string& text) { precision = text == "fp32" ? DType::f32 : DType::f16; });
}

Result<uint8_t> class_option(std::string_view option, const std::string& text)
{
    const Result<uint8_t> label = parse_class(text);
    if (!label)
        return fail(ErrorCode::usage, "{}: {}", option, label.error().message);
    return *label;
}

Result<uint64_t> parse_memory_size(std::string_view text)
{
    double number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    std::string_view unit = text.substr(size_t(end - text.data()));
    unit.remove_prefix(std::min(unit.find_first_not_of(' '), unit.size()));
    const double scale = unit.empty() ? (number < kGigabytesBelow ? 1e9 : 1) : unit_bytes(unit);
    if (error != std::errc() || !(number >= 0) || scale == 0 || number * scale > 1e18)
        return fail(ErrorCode::usage, "expected an amount of memory such as 6GiB, 500MB or 2.2 (GB), found {}",
                    quote(text));
    return uint64_t(std::llround(number * scale));
}

} // namespace semrover
