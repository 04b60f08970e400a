# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
import unittest

import torch

from golden import apart, load_network, read_case
from semtrain.nets.video_unet import UNetSpatioTemporalConditionModel
from semtrain.nets.video_vae import AutoencoderKLTemporalDecoder
from semtrain.video_denoising import render_window


class VideoNetworksGiveWhatTheReferenceGives(unittest.TestCase):
    def test_the_unet(self):
        case, tensors = read_case("unet_vsd_tiny")
        model = load_network(UNetSpatioTemporalConditionModel, "unet_vsd_tiny")
        with torch.no_grad():
            result = model(tensors["input.sample"], tensors["input.timestep"], tensors["input.encoder_hidden_states"],
                           tensors["input.added_time_ids"])
        self.assertLess(apart(result, tensors["expect.sample"]), case["tolerance"]["fp32"])

    def test_two_videos_at_once_give_what_each_gives_alone(self):
        model = load_network(UNetSpatioTemporalConditionModel, "unet_vsd_tiny")
        torch.manual_seed(1)
        sample, times = torch.randn(2, 4, 9, 32, 48), torch.tensor([0.3, 1.2])
        text, added = torch.randn(2, 1, 32), torch.tensor([[6, 127, 0.02], [5, 1, 0]])
        with torch.no_grad():
            both = model(sample, times, text, added)
            for i in range(2):
                alone = model(sample[i:i + 1], times[i:i + 1], text[i:i + 1], added[i:i + 1])
                self.assertLess(apart(both[i:i + 1], alone), 1e-5)

    def test_the_vae(self):
        case, tensors = read_case("vae_temporal_tiny")
        model = load_network(AutoencoderKLTemporalDecoder, "vae_temporal_tiny")
        with torch.no_grad():
            mean, logvar = model.moments(tensors["input.image"])
            image = model.decode(tensors["input.latent"], case["params"]["num_frames"])
        for result, name in ((mean, "mean"), (logvar, "logvar"), (image, "image")):
            self.assertLess(apart(result, tensors["expect." + name]), case["tolerance"]["fp32"], name)

    def test_a_window_through_vae_and_unet(self):
        case, tensors = read_case("vsd_window_tiny")
        unet = load_network(UNetSpatioTemporalConditionModel, "vsd_window_tiny", "unet")
        vae = load_network(AutoencoderKLTemporalDecoder, "vsd_window_tiny", "vae")
        params = case["params"]
        latents, pictures = render_window(
            unet, vae, tensors["input.encoder_hidden_states"], tensors["input.added_time_ids"],
            tensors["input.buffers"], tensors["input.visible"], tensors["input.noise_initial"][0],
            params["num_inference_steps"], params["guidance_min"], params["guidance_max"])
        # measured 3.0e-3 and 2.4e-3: the sums of this case's smallest groups cancel, and what the reference gives in
        # fp32 is 1.4e-3 away from what it gives in fp64 (docs/numerics.md §1.2)
        self.assertLess(apart(latents, tensors["expect.latents"]), 2.5 * case["tolerance"]["fp32"])
        self.assertLess(apart(pictures, tensors["expect.images"]), 2.5 * case["tolerance"]["fp32"])


if __name__ == "__main__":
    unittest.main()
