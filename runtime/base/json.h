// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"
#include "runtime/base/json_allocator.h"
#include "runtime/base/result.h"

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

namespace semrover {

using Json = nlohmann::json;

// Base of strict readers of JSON events. The first refusal stops the parser and is kept. The events are nlohmann's;
// its parser keeps no call stack, so depth costs nothing until a handler allows it.
class JsonEvents : public nlohmann::json_sax<Json> {
  public:
    bool binary(binary_t&) override { return refuse("found binary data"); } // never in text
    bool parse_error(size_t position, const std::string& last_token, const nlohmann::detail::exception& e) override;

    const std::string& refusal() const { return refusal_; }

  protected:
    bool refuse(std::string reason); // always false

  private:
    std::string refusal_;
};

// Parses `text`, a whole document (one value, white space around it), and calls `events` for each event. bad_input,
// with `where` in front: a byte order mark, a NUL byte, broken UTF-8 or syntax, and what `events` refuses.
Status parse_json_events(std::string_view text, std::string_view where, JsonEvents& events);

struct JsonLimits {
    uint64_t bytes = 16u << 20;
    uint32_t depth = 32;
    uint32_t values = 2u << 20;      // arrays, objects, strings, numbers, ... together
    uint32_t containers = 256 << 10; // arrays and objects, which take 64 bytes or more where the text has two
};

// Parses a document into a value. bad_input as above, and for duplicate keys at any level and numbers beyond double.
Result<Json> parse_json(std::string_view text, std::string_view where, const JsonLimits& limits = {});
Result<Json> read_json(const Path& path, const JsonLimits& limits = {});

// Parses an array of values and calls `record` with each and its number from 0, so that only one is in memory.
// `limits.depth` and `limits.values` are those of one. Errors: bad_input as above and for what is no array, and what
// `record` returns.
Status parse_json_records(std::string_view text, std::string_view where, const JsonLimits& limits,
                          const std::function<Status(const Json& value, size_t number)>& record);

// The text of a value on one line, or with an indent. Names of files may be no UTF-8: those bytes become U+FFFD.
template <typename Value>
std::string json_text(const Value& value, int indent = -1, bool ascii = false)
{
    return value.dump(indent, ' ', ascii, Value::error_handler_t::replace);
}

// a float's shortest digits: 0.18215, not 0.18215000629425049
Json short_number(float value);

} // namespace semrover
