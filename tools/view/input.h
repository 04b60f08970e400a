// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace semrover::view {

class Viewer;

// what mouse and keys do, where no panel takes them. Between the beginning and the end of the overlay's frame
void take_input(Viewer& viewer);

} // namespace semrover::view
