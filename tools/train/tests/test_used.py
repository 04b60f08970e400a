# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Pixels that a drive says are not used: neither loss nor gradients of asd and vsd know them."""
import os
import unittest

import numpy as np
import torch
from PIL import Image

from semtrain import asd, vsd
from semtrain.denoising import alphas_cumprod, mean_of_used
from semtrain.draws import draws
from test_latents import WithAVae
from test_recipes_asd import ASD, draw_drive
from test_recipes_vsd import VSD

HIDDEN = (slice(8, 27), slice(16, 40))  # rows and columns: blocks 1 to 3 and 2 to 4 of 8 pixels have some


class Used(WithAVae):
    def setUp(self):
        super().setUp()
        self.drive = self.path("frames", "0")
        draw_drive(self.drive, 0)

    def hide(self, where=HIDDEN, numbers=range(3)):
        os.makedirs(os.path.join(self.drive, "used"), exist_ok=True)
        for number in numbers:
            used = np.full((48, 64), 255, np.uint8)
            used[where] = 0
            Image.fromarray(used).save(os.path.join(self.drive, "used", f"{number:06d}.png"))

    def change(self, row, column):
        """a pixel of every frame's truth"""
        for number in range(3):
            path = os.path.join(self.drive, "color", f"{number:06d}.png")
            pixels = np.array(Image.open(path))
            pixels[row, column] = 255 - pixels[row, column]
            Image.fromarray(pixels).save(path)

    def asd_step(self):
        """-> loss and gradients of two steps"""
        config = {**ASD, "mirror": True}
        torch.manual_seed(1)
        model = asd.Renderer(config)
        batches = asd.Batches(self.sequences(), config)
        return self.step(model, lambda s: asd.step_loss(model, batches.make(s), alphas_cumprod(), config,
                                                        draws(config, s, 1))[0])

    def vsd_step(self):
        torch.manual_seed(1)
        model = vsd.Renderer(VSD)
        batches = vsd.Batches(self.sequences(), VSD, self.vae.config)
        return self.step(model, lambda s: vsd.step_loss(model, batches.make(s), VSD, draws(VSD, s, 1))[0])

    @staticmethod
    def step(model, loss_of):
        loss = loss_of(0) + loss_of(1)
        loss.backward()
        return loss.detach(), torch.cat([p.grad.flatten() for p in model.parameters() if p.grad is not None])

    def test_a_pixel_that_is_not_used_changes_neither_loss_nor_gradients(self):
        for step in (self.asd_step, self.vsd_step):
            self.hide()
            loss, gradients = step()
            self.assertGreater(float(gradients.abs().max()), 0)
            self.change(20, 30)
            again, others = step()
            self.assertTrue(torch.equal(loss, again))
            self.assertTrue(torch.equal(gradients, others))
            self.change(40, 30)  # used
            again, others = step()
            self.assertFalse(torch.equal(loss, again))
            self.assertFalse(torch.equal(gradients, others))

    def test_errors_count_where_all_pixels_of_a_block_are_used(self):
        self.hide()
        for sequence in self.sequences():
            used = sequence.used[0][0]
            self.assertEqual(int((used == 0).sum()), 9)
            self.assertEqual(int((used == 1).sum()), 48 - 9)
        plain, mirrored = (sequence.used[0][0] for sequence in self.sequences())
        self.assertEqual(int(plain[1:4, 2:5].max()), 0)
        self.assertTrue(torch.equal(mirrored, plain.flip(1)))
        squares = torch.ones(2, 4, 6, 8)
        squares[:, :, 1:4, 2:5] = 1000
        self.assertEqual(mean_of_used(squares, plain.expand(2, 1, 6, 8)).tolist(), [1, 1])
        self.assertEqual(mean_of_used(squares, torch.zeros(2, 1, 6, 8)).tolist(), [0, 0])

    def test_without_such_pictures_nothing_is_different(self):
        config = {**ASD, "mirror": True}
        sequences = self.sequences()
        self.assertEqual({s.used for s in sequences}, {None})
        batches = asd.Batches(sequences, config)
        truth, previous, buffer, visible = batches.make(3)
        torch.manual_seed(1)
        model = asd.Renderer(config)
        random, alphas = draws(config, 3, 1), alphas_cumprod()
        t = random.of_part(asd.draw_timesteps(random.batch, config, random.random))
        noise, a = random.normal(truth.shape[1:]), alphas[t].view(-1, 1, 1, 1)
        noisy = a.sqrt() * truth + (1 - a).sqrt() * noise
        made = model(noisy, previous, buffer, visible, t)
        error = (a.sqrt() * made + (1 - a).sqrt() * noisy - noise).square().mean((1, 2, 3))
        loss = asd.step_loss(model, batches.make(3), alphas, config, draws(config, 3, 1))[0]
        self.assertTrue(torch.equal(loss, (1 / a.flatten() * error).mean()))

    def test_a_changed_mask_makes_other_latents(self):
        plain = self.sequences()[0].truth[:]
        self.hide()
        hidden = self.sequences()[0]
        self.hide((slice(0, 8), slice(0, 8)))
        other = self.sequences()[0]
        self.assertFalse(torch.equal(plain, hidden.truth[:]))
        self.assertFalse(torch.equal(hidden.truth[:], other.truth[:]))
        self.assertEqual(int((other.used[0] == 0).sum()), 1)

    def test_drives_with_and_without_masks_train_together(self):
        draw_drive(self.path("frames", "1"), 1)
        self.hide(numbers=[1])
        sequences = self.sequences()
        self.assertEqual([s.used is None for s in sequences], [False, True, False, True])
        self.assertEqual([float(sequences[0].used[i].min()) for i in range(3)], [1, 0, 1])
        batch = asd.Batches(sequences, {**ASD, "batch": 16}).make(0)
        self.assertEqual(tuple(batch[4].shape), tuple(batch[3].shape))
        self.assertEqual(set(batch[4].unique().tolist()), {0, 1})


if __name__ == "__main__":
    unittest.main()
