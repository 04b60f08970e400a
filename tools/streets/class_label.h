// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace semrover::label {

// engine/scene/palette.h by name
constexpr uint8_t kRoad = 0, kSidewalk = 1, kBuilding = 2, kWall = 3, kFence = 4, kPole = 5, kTrafficLight = 6,
                  kTrafficSign = 7, kVegetation = 8, kTerrain = 9, kSky = 10, kPerson = 11, kRider = 12, kCar = 13,
                  kTruck = 14, kBus = 15, kTrain = 16, kMotorcycle = 17, kBicycle = 18, kRoadLane = 19;

} // namespace semrover::label
