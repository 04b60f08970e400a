// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/open_device.h"

#include "runtime/device/device_choice.h"
#include "runtime/device/profile.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/session.h"

#include <cstdlib>

namespace semrover {

Result<std::shared_ptr<Device>> open_device(const Globals& globals, const std::string& profile, bool statistics)
{
    if (globals.session && globals.session->device)
        return globals.session->device;
    DeviceOptions options;
    const bool engine = is_under_engine(std::getenv);
    options.select = globals.device.empty() && engine ? "auto" : globals.device;
    options.require_gpu = globals.require == "gpu" || (globals.require.empty() && engine);
    options.max_bytes = globals.max_vram;
    options.autotune = globals.autotune;
    options.cancelled = interrupt_requested;
    options.pipeline_statistics = statistics || !profile.empty();
    SR_TRY(std::shared_ptr<Device> device, Device::create(options));
    if (globals.session)
        globals.session->device = device;
    if (!profile.empty())
        device->set_profile(std::make_shared<Profile>());
    return device;
}

Status write_profile(Device& device, const std::string& path, const Globals& globals)
{
    if (path.empty())
        return {};
    SR_CHECK(device.profile()->write(path));
    if (globals.verbose)
        print_stderr("{}{}", device.profile()->summary(), device.profile()->statistics());
    return {};
}

} // namespace semrover
