# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
import unittest

from golden import apart, load_network, read_case
from semtrain.denoising import rollout
from semtrain.nets.unet import UNet2DConditionModel
from semtrain.nets.vae import AutoencoderKL


class RolloutGivesWhatTheReferenceGives(unittest.TestCase):
    def test_three_frames_through_vae_and_unet(self):
        case, tensors = read_case("asd_rollout_tiny")
        unet = load_network(UNet2DConditionModel, "asd_rollout_tiny", "unet")
        vae = load_network(AutoencoderKL, "asd_rollout_tiny", "vae")
        params = case["params"]
        latents, pictures = rollout(
            unet, vae, tensors["input.encoder_hidden_states"], tensors["input.buffers"], tensors["input.visible"],
            tensors["input.noise_initial"], tensors["input.noise_previous"], params["num_inference_steps"],
            params["guidance_scale"], params["previous_noise_scale"])
        self.assertLess(apart(latents, tensors["expect.latents"]), case["tolerance"]["fp32"])
        self.assertLess(apart(pictures, tensors["expect.images"]), case["tolerance"]["fp32"])


if __name__ == "__main__":
    unittest.main()
