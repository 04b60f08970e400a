// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/streets/pattern.h"
#include "tools/streets/pattern_canvas.h"

namespace semrover::paint {

// each paints its patterns onto a canvas of the pattern's size
void ground(PatternCanvas& canvas, Pattern pattern);
void wall(PatternCanvas& canvas, Pattern pattern);
void opening(PatternCanvas& canvas, Pattern pattern); // windows, doors, shops
void plant(PatternCanvas& canvas, Pattern pattern);
void vehicle(PatternCanvas& canvas, Pattern pattern);
void sign(PatternCanvas& canvas, Pattern pattern);

} // namespace semrover::paint
