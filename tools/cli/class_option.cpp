// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/class_option.h"

#include "tools/editing/cell_selection.h"

namespace semrover {

Result<uint8_t> class_option(std::string_view option, const std::string& text)
{
    const Result<uint8_t> label = parse_class(text);
    if (!label)
        return fail(ErrorCode::usage, "{}: {}", option, label.error().message);
    return *label;
}

} // namespace semrover
