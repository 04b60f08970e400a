// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// which row of the views of movers a thing has: MoverRows is what SplatOptions::mover_rows of kernels/splat.h says
uint mover_of(uint owner, uint known) { return owner < known ? mover_rows[owner] : 0; }
