# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Random numbers of a step. They depend on the seed and the step alone: not on where a run was stopped, nor on how the
batch is divided."""
import torch


def generator(config, step, stream=0):
    """random numbers of a step: a run that is continued draws what one that was not interrupted would"""
    return torch.Generator().manual_seed((config["seed"] * 1000003 + step) * 16 + stream)


def number_below(n, draw):
    """0..n - 1, from a generator"""
    return int(torch.randint(n, (1,), generator=draw))


def timesteps_at(shares, count, power):
    """shares of 0..1, raised to a power -> timesteps below count: with a power above 1 more are low, below 1 fewer"""
    return (shares ** power * count).long().clamp(max=count - 1)


class Draws:
    """Numbers of each sample of a batch, from a torch.Generator: drawn for all of `batch`, given of `part`, a range of
    them (None: all)"""

    def __init__(self, random, batch, part=None):
        self.random, self.batch, self.part = random, batch, part

    def of_part(self, values):
        """[batch, ...] -> [part, ...]"""
        return values if self.part is None else values[self.part.start:self.part.stop]

    def normal(self, shape=()):
        return self.of_part(torch.randn((self.batch, *shape), generator=self.random))

    def uniform(self, shape=()):
        """0..1"""
        return self.of_part(torch.rand((self.batch, *shape), generator=self.random))

    def below(self, n):
        """0..n - 1 -> i64 [part]"""
        return self.of_part(torch.randint(n, (self.batch,), generator=self.random))


def draws(config, step, stream=0, part=None):
    return Draws(generator(config, step, stream), config["batch"], part)
