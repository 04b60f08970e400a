# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""What windows do to flicker at their seams, with a network that knows everything: frames are Gaussian numbers whose
correlation falls from one to the next, so that the best guess of clean frames is a matrix (docs/method.md §6.4)."""
import unittest

import torch

from semtrain.video_denoising import denoise_window, windows

FRAMES, LENGTH, STEPS, PIXELS = 28, 12, 25, 3000
CORRELATION = 0.97  # of neighbouring frames; the correction takes 0.9


def best_guess(frames):
    at = torch.arange(frames)
    covariance = (CORRELATION ** (at[:, None] - at).abs()).double()

    def clean(x, sigma):
        noisy = covariance + float(sigma) ** 2 * torch.eye(frames, dtype=torch.float64)
        return (torch.linalg.solve(noisy, covariance) @ x.double()).float()
    return clean


def drive(overlap, correlation, fresh=False):
    """[FRAMES, PIXELS]; fresh: known frames get other noise at every level"""
    draw = torch.Generator().manual_seed(1)
    noise, made = torch.randn(FRAMES, PIXELS, generator=draw), torch.zeros(FRAMES, PIXELS)
    for first, known, end in windows(FRAMES, LENGTH, overlap):
        guess, z = best_guess(end - first), noise[first:end].clone()

        def clean(x, sigma, known=known, guess=guess, z=z):
            if fresh:
                z[:known] = torch.randn(known, PIXELS, generator=draw)
            return guess(x, sigma)
        made[first + known:end] = denoise_window(clean, z, STEPS, made[first:first + known], correlation)[known:]
    return made


def changes(overlap, correlation, fresh=False):
    """deviation of the change from a frame to the next: into a window's first new frame, and elsewhere"""
    made = drive(overlap, correlation, fresh)
    change = (made[1:] - made[:-1]).square().mean(1).sqrt()
    seams = [first + known - 1 for first, known, _ in windows(FRAMES, LENGTH, overlap)][1:]
    inside = [i for i in range(FRAMES - 1) if i not in seams]
    return float(change[seams].mean()), float(change[inside].mean())


class FlickerAtSeams(unittest.TestCase):
    def test_what_is_known_makes_seams_nearly_as_quiet_as_the_rest(self):
        true = (2 * (1 - CORRELATION)) ** 0.5
        rows = {}
        for overlap, correlation, fresh, name in (
                (0, 0, False, "nothing known but to the last window"), (4, 0, True, "held with other noise at each level"),
                (4, 0, False, "held with the noise that they began with"), (1, 0.9, False, "and corrected, overlap 1"),
                (4, 0.9, False, "and corrected, overlap 4")):
            rows[name] = changes(overlap, correlation, fresh)
            print(f"{name}: {rows[name][0]:.3f} at seams, {rows[name][1]:.3f} between; true {true:.3f}")
        free, other, held, _, corrected = (seam for seam, _ in rows.values())
        self.assertGreater(free, 3 * true)
        self.assertLess(held, other)
        self.assertLess(other, free)
        self.assertLess(corrected, 0.6 * held)
        self.assertLess(abs(corrected / true - 1), 0.15)

    def test_windows_are_those_of_the_engine(self):
        self.assertEqual(windows(30, 12, 4), [(0, 0, 12), (8, 4, 20), (16, 4, 28), (18, 10, 30)])
        self.assertEqual(windows(3, 12, 4), [(0, 0, 3)])


if __name__ == "__main__":
    unittest.main()
