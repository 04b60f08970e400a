# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""A street to drive in, with the interface of gymnasium.Env (reset, step, spaces left out): street_env.py GRID

Observations are what a camera on the vehicle sees: colour, depth and class. Actions are acceleration (m/s^2) and yaw
rate (radians/s). An episode ends where the vehicle leaves the road, or after `most_steps`.
"""
import sys

import numpy
import semrover


class StreetEnv:
    """grid: with points (generated, or a .sgrid file). start: x, y (metres) and heading (radians)."""

    dt, height = 0.1, 1.7  # seconds, metres
    drivable = tuple(semrover.CLASSES.index(name) for name in ("road", "road-lane"))

    def __init__(self, grid, start, size=(154, 106), most_steps=100, device=None):
        self.context = semrover.Context(device)
        self.grid = semrover.Grid.read(grid) if isinstance(grid, str) else grid
        self.world = semrover.World(self.context, grid=self.grid)
        for _ in self.world.fill_grid(self.grid):
            pass
        self.camera = semrover.Camera.of_view(*size, 73)
        cells = self.grid.cells
        road = cells[numpy.isin(cells["label"], self.drivable)]
        self.road = set(zip(road["i"].tolist(), road["j"].tolist()))
        self.start, self.most_steps = start, most_steps

    def reset(self, seed=None):
        """(observation, info)"""
        random = numpy.random.default_rng(seed)
        self.x, self.y, self.heading = self.start
        self.y += random.uniform(-0.3, 0.3)
        self.speed, self.steps = 5.0, 0
        return self._observe(), {}

    def step(self, action):
        """(observation, reward: metres driven on the road, terminated, truncated, info)"""
        acceleration, yaw_rate = action
        self.speed = float(numpy.clip(self.speed + acceleration * self.dt, 0, 20))
        self.heading += yaw_rate * self.dt
        self.x += self.speed * self.dt * numpy.cos(self.heading)
        self.y += self.speed * self.dt * numpy.sin(self.heading)
        self.steps += 1
        on_road = self._cell() in self.road
        return (self._observe(), self.speed * self.dt if on_road else -1.0, not on_road,
                self.steps >= self.most_steps, {"position": (self.x, self.y), "speed": self.speed})

    def _cell(self):
        return tuple(int(numpy.floor(v / self.grid.voxel_size)) for v in (self.x, self.y))

    def _observe(self):
        pose = semrover.look((self.x, self.y, self.height), self.heading)
        seen = self.world.draw(self.camera.at(pose, self.steps * self.dt), color="uint8", depth=True, label="uint8")
        return {"color": seen["color"][:, :, :3], "depth": seen["depth"][:, :, 1], "label": seen["label"]}

    def close(self):
        self.context.close()


if __name__ == "__main__":
    env = StreetEnv(sys.argv[1], start=(6.0, -1.5, 0.0))
    observation, _ = env.reset(seed=1)
    total, done = 0.0, False
    while not done:
        ahead = observation["depth"][40:66, 67:87]  # keeps 8 m away from what is ahead
        near = numpy.median(ahead[ahead > 0]) if (ahead > 0).any() else 100.0
        observation, reward, terminated, truncated, info = env.step((1.0 if near > 8 else -4.0, 0.0))
        total += reward
        done = terminated or truncated
    print(f"{env.steps} steps, {total:.1f} m, at {info['position'][0]:.1f}, {info['position'][1]:.1f}")
    env.close()
