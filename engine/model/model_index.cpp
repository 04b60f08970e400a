// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/model_index.h"

#include "runtime/base/quote.h"

namespace semrover {

Result<Json> read_model_index(const Path& folder)
{
    const Path path = folder / "model_index.json";
    if (!is_there(path))
        return Json::object();
    SR_TRY(Json index, read_json(path));
    if (!index.is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object, found {}", quote_path(path), index.type_name());
    return index;
}

} // namespace semrover
