// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// index of this invocation in a grid of threads(n), which the runtime folds over y when there are too many groups
uint linear_thread()
{
    return gl_GlobalInvocationID.x + gl_GlobalInvocationID.y * gl_NumWorkGroups.x * gl_WorkGroupSize.x;
}
