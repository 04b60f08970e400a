// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/cli/commands.h"
#include "tools/run/job_file.h"

namespace semrover {

// A command that tasks are run by, and what of its options a job may give
class CommandOptions {
  public:
    // Of a command of this program, or of one that the program beside it runs, which is asked. `taken`: options that
    // the job itself gives
    static Result<CommandOptions> create(const char* command, std::vector<std::string> taken);

    // The option that a key of a job names ("cfg_scale" or "cfg-scale"); null where there is none
    const Json* find(std::string_view key) const;
    std::vector<std::string> keys() const; // all that a job may give
    // A value as the command line takes it. bad_input, without a place: of another kind, or out of range
    Result<std::optional<JobOption>> option(const Json& facts, std::string_view key, const JobValue& value) const;

  private:
    std::map<std::string, Json> options_; // by name, without dashes
};

void append_options(std::vector<std::string>& line, const std::vector<JobOption>& options);
// Whether a command of this program takes this command line. usage: why not
Status check_command(const std::vector<std::string>& arguments);
// Runs a command of this program in this process. Errors: the command's; usage for a command line that it refuses
Status run_command(const std::vector<std::string>& arguments, const Globals& globals);
// of semrover-scenes beside this program, as a child that is waited for; what it prints goes to standard error
Status run_scenes_command(const std::vector<std::string>& arguments);

} // namespace semrover
