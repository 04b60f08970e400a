// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"

#include <array>
#include <cmath>
#include <initializer_list>
#include <optional>
#include <set>
#include <span>
#include <vector>

namespace semrover {

// Reads the fields of a JSON object into variables that hold the defaults, with bounds. A field that is absent or null
// leaves its variable as it is, as in diffusers' configs. finish() reports the first field that was wrong, and the
// fields that nothing read.
class JsonFields {
  public:
    template <typename T>
    using Names = std::initializer_list<std::pair<const char*, T>>;

    // `where` starts each message: "scheduler config". finish() refuses anything but an object.
    JsonFields(const Json& object, std::string where);

    void flag(const char* name, bool& out);

    template <typename T>
    void integer(const char* name, T low, T high, T& out)
    {
        if (const Json* value = find(name)) {
            const double number = value->is_number_integer() ? value->get<double>() : NAN;
            if (!(number >= double(low) && number <= double(high)))
                return refuse(name, fmt::format("a whole number from {} to {}", low, high));
            out = value->get<T>();
        }
    }

    template <typename T>
    void number(const char* name, T low, T high, T& out)
    {
        if (const Json* value = find(name)) {
            const double number = value->is_number() ? value->get<double>() : NAN;
            if (!(number >= double(low) && number <= double(high)))
                return refuse(name, fmt::format("a number from {} to {}", low, high));
            out = static_cast<T>(number);
        }
    }

    void optional_number(const char* name, double low, double high, std::optional<double>& out);

    // one number for all of `count` entries, or a list of that many
    void integers(const char* name, size_t count, uint32_t low, uint32_t high, std::vector<uint32_t>& out);
    // a list of 1 to `most` numbers
    void list(const char* name, size_t most, uint32_t low, uint32_t high, std::vector<uint32_t>& out);

    // a list of 1 to `most` lists of three numbers
    void triples(const char* name, size_t most, double low, double high, std::vector<std::array<double, 3>>& out);

    template <typename T>
    void choice(const char* name, Names<T> names, T& out)
    {
        const Json* value = find(name);
        if (!value)
            return;
        for (const auto& [text, meaning] : names)
            if (*value == text) {
                out = meaning;
                return;
            }
        refuse(name, expected(names));
    }

    // a list of names, each of which means a value
    template <typename T>
    void choices(const char* name, Names<T> names, std::vector<T>& out)
    {
        const Json* value = find(name);
        if (!value)
            return;
        if (!value->is_array())
            return refuse(name, "a list of " + expected(names));
        out.clear();
        for (const Json& entry : *value) {
            for (const auto& [text, meaning] : names)
                if (entry == text) {
                    out.push_back(meaning);
                    break;
                }
        }
        if (out.size() != value->size())
            refuse(name, "a list of " + expected(names));
    }

    // a feature that the engine lacks: only this value, or a list of nothing else, is accepted
    void only(const char* name, const Json& supported);
    void ignore(const char* name) { find(name); }
    void ignore(std::initializer_list<const char*> names);
    // refuses null, for fields where it has a meaning of its own
    void refuse_null(const char* name, std::string_view expected);

    const Json* find(const char* name); // null when absent or null
    void refuse(const char* name, std::string_view expected);

    // bad_input for the first field that was wrong; else adds a warning for each field that was not read
    Status finish(std::vector<std::string>& warnings) const;

  private:
    template <typename T>
    static std::string expected(Names<T> names)
    {
        std::string text;
        for (const auto& name : names)
            text += fmt::format("{}\"{}\"", text.empty() ? "" : ", ", name.first);
        return text;
    }

    const Json& object_;
    std::string where_;
    std::set<std::string, std::less<>> seen_;
    std::optional<Error> error_;
};

// of what is read by hand; bad_input with `where` in front
Status check_keys(const Json& object, std::span<const std::string_view> known, std::string_view where);
Status check_array(const Json& value, std::string_view key, std::string_view where);

} // namespace semrover
