// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/open_device.h"

namespace semrover {

Result<std::unique_ptr<Device>> open_device(const Globals& globals)
{
    DeviceOptions options;
    options.select = globals.device;
    options.max_bytes = globals.max_vram;
    return Device::create(options);
}

Result<RunFolder> open_run(const Path& folder, const Json& settings, bool replace, const RunContents& contents)
{
    if (!replace)
        return RunFolder::open(folder, settings, false, contents);
    const auto before = read_json(folder / "run.json");
    const bool same = before && before->is_object() && before->value("settings", Json()) == settings &&
                      before->value("state", "") == "running";
    return RunFolder::open(folder, settings, !same, contents);
}

} // namespace semrover
