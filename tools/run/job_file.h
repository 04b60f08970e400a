// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"
#include "tools/run/job_tree.h"

#include <map>

namespace semrover {

constexpr const char* kBufferKinds[] = {"color",   "depth",    "normal", "label",
                                        "visible", "instance", "flow",   "flow_state"};

// An option of a command as the job gives it: "--steps", "20"; a flag has no value
using JobOption = std::pair<std::string, std::string>;

struct JobScene {
    enum class Source : uint8_t {
        labels, // generated of a grid
        street, // generated of a street that is made up
        points, // a grid or splats that are drawn as they are
    };

    Source source = Source::labels;
    std::string name;                    // of a folder, unique in the job
    Path file = {};                      // labels, points
    std::string objects = {};            // labels: a file, auto or none; empty: auto
    std::vector<JobOption> streets = {}; // of the command `streets`, its seed too
    uint64_t weight = 0;                 // about as its work: of a file its bytes, of a street its metres times 10000
};

struct JobDrive {
    std::string name; // of a folder, unique in the job
    bool made = false;
    std::string path = {};               // a file or folder, where {scene} stands for the scene's name; empty: made
    std::string scenes = {};             // names of the scenes it leads through, with * and ?; empty: all
    Path rig = {};                       // empty: none
    std::vector<JobOption> options = {}; // of render or refine
};

enum class JobLayout : uint8_t { folder, shards };

// What a job file asks for (docs/cluster.md), with all paths resolved, and found to be there.
struct JobFile {
    Path path, out;
    std::string name;
    Path model = {}; // empty: nothing is generated or refined
    uint64_t seed = 0;
    std::vector<JobScene> scenes;
    std::vector<JobDrive> drives;
    std::vector<JobOption> generate;
    bool refined = false; // drives are by `refine`, else by `render`
    JobLayout layout = JobLayout::folder;
    std::string shard_bytes = {};          // as `dataset pack` takes them; empty: as usual
    std::vector<std::string> buffers = {}; // kinds of pictures that are kept; empty: all
};

// out: in place of the job's own; empty: none. Errors: bad_input with line and column of what is not understood: an
// unknown key (with the one that it may stand for), a value of another kind or out of range, names that stand twice,
// files that are not there; usage without a folder to write to
Result<JobFile> read_job_file(const Path& path, const Path& out);

} // namespace semrover
