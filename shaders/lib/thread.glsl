// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// index of this workgroup in a grid of row_tiles(n); the last ones may lie beyond n
uint linear_group() { return gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x; }

// index of this invocation in a grid of threads(n), which the runtime folds over y when there are too many groups
// note: a macro, because gl_WorkGroupSize is 1 in front of the layout that sets it, and libraries are included there
#define linear_thread() (linear_group() * gl_WorkGroupSize.x + gl_LocalInvocationID.x)
