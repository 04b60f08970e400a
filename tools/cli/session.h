// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/model.h"
#include "runtime/base/json.h"

#include <map>

namespace semrover {

// What commands that one process runs one after the other share: the device, and networks on it, which are loaded
// once. They stay until the session ends or drops them.
class Session {
  public:
    std::shared_ptr<Device> device; // null until a command has opened one
    Json results;                   // of the last command that has any, in place of printing them

    // Errors: as Model::load()
    Result<std::shared_ptr<const Transformer>> transformer(const Path& model, DType precision);
    Result<std::shared_ptr<LoadedNetworks>> renderer(const Path& model, DType precision);
    void drop_models() { models_.clear(); }

  private:
    Result<Model*> model(const Path& path, DType precision, bool renderer);

    std::map<std::tuple<Path, DType, bool>, std::shared_ptr<Model>> models_; // bool: the renderer, or the transformer
};

} // namespace semrover
