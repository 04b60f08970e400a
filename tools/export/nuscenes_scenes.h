// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace semrover {

// Names of nuScenes' scenes of its splits `train` (700) and `val` (150), in order. Readers ask for these alone, so a
// data set of ours takes them. Source: python-sdk/nuscenes/utils/splits.py of
// https://github.com/nutonomy/nuscenes-devkit
std::vector<std::string> nuscenes_train_scenes();
std::vector<std::string> nuscenes_val_scenes();

} // namespace semrover
