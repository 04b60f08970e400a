# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
import unittest

import torch

from golden import apart, read_case
from semtrain.denoising import SCHEDULER, alphas_cumprod, ddim_step, ddim_timesteps, denoise, velocity


class Denoising(unittest.TestCase):
    def test_ddim_steps_as_the_reference_does(self):
        case, tensors = read_case("scheduler_ddim_epsilon")
        steps = case["params"]["num_inference_steps"]
        for i, t in enumerate(ddim_timesteps(steps)):
            state = tensors["expect.states"][i]
            made = ddim_step(tensors["input.model_outputs"][i], t, steps, state, alphas_cumprod())
            self.assertLess(apart(made, tensors["expect.states"][i + 1]), case["tolerance"]["fp32"])

    def test_trailing_steps_begin_with_pure_noise(self):
        self.assertEqual(ddim_timesteps(8, "trailing"), [999, 874, 749, 624, 499, 374, 249, 124])

    def test_a_network_that_knows_the_picture_finds_it_whatever_it_predicts(self):
        random = torch.Generator().manual_seed(1)
        clean, start = torch.randn(2, 1, 4, 6, 6, generator=random)
        alphas = alphas_cumprod()

        def noise_in(x, a):
            return (x - a.sqrt() * clean) / (1 - a).sqrt()

        def of_velocity(x, t, text):
            return velocity(clean, noise_in(x[:, :4], alphas[t]), alphas[t])

        for prediction, network in (("epsilon", lambda x, t, text: noise_in(x[:, :4], alphas[t])),
                                    ("v_prediction", of_velocity)):
            scheduler = {**SCHEDULER, "prediction_type": prediction, "timestep_spacing": "trailing"}
            made = denoise(network, None, start, start, start, start[:, :1], 8, 1.0, scheduler)
            last = (1 - alphas[0]).sqrt() * 4  # the sampler ends at timestep 0, which still has a little noise
            self.assertLess(float((made - clean).abs().max()), last, prediction)


if __name__ == "__main__":
    unittest.main()
