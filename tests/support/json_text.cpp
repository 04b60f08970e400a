// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/json_text.h"

#include <ostream>

namespace semrover {

nlohmann::json json_of(const std::string& text)
{
    return nlohmann::json::parse(text);
}

} // namespace semrover

NLOHMANN_JSON_NAMESPACE_BEGIN
void PrintTo(const json& value, std::ostream* out)
{
    *out << value.dump(1);
}
NLOHMANN_JSON_NAMESPACE_END
