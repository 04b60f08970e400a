// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/session.h"

namespace semrover {

Result<Model*> Session::model(const Path& path, DType precision, bool renderer)
{
    std::shared_ptr<Model>& there = models_[{path, precision, renderer}];
    if (!there) {
        ModelRequest request{.path = path, .precision = precision};
        request.voxfield = !renderer;
        request.renderer = renderer;
        request.if_there = false;
        SR_TRY(there, Model::load(*device, std::move(request)));
    }
    return there.get();
}

Result<std::shared_ptr<const Transformer>> Session::transformer(const Path& path, DType precision)
{
    SR_TRY(const Model* loaded, model(path, precision, false));
    return loaded->transformer();
}

Result<std::shared_ptr<LoadedNetworks>> Session::renderer(const Path& path, DType precision)
{
    SR_TRY(const Model* loaded, model(path, precision, true));
    return loaded->renderer();
}

} // namespace semrover
