# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
import unittest

import torch

from golden import apart, load_network, read_case
from semtrain.nets.vae import AutoencoderKL


class VaeGivesWhatTheReferenceGives(unittest.TestCase):
    def test_moments_and_picture_of_the_golden_case(self):
        case, tensors = read_case("vae_tiny")
        model = load_network(AutoencoderKL, "vae_tiny")
        with torch.no_grad():
            mean, logvar = model.moments(tensors["input.image"])
            image = model.decode(tensors["input.latent"])
        for result, name in ((mean, "mean"), (logvar, "logvar"), (image, "image")):
            self.assertLess(apart(result, tensors["expect." + name]), case["tolerance"]["fp32"], name)

    def test_without_attention_and_quantization_it_has_none_of_their_tensors(self):
        model = AutoencoderKL({"block_out_channels": [8, 16], "norm_num_groups": 8, "mid_block_add_attention": False,
                               "use_quant_conv": False, "use_post_quant_conv": False})
        self.assertFalse([n for n in model.state_dict() if "attentions" in n or "quant_conv" in n])
        mean, logvar = model.moments(torch.zeros(2, 3, 10, 14))
        self.assertEqual(tuple(mean.shape), (2, 4, 5, 7))
        self.assertEqual(tuple(model.decode(mean).shape), (2, 3, 10, 14))

    def test_in_bf16_with_channels_last_it_gives_nearly_the_same(self):
        torch.manual_seed(1)
        model = AutoencoderKL({"block_out_channels": [16, 32], "norm_num_groups": 8, "layers_per_block": 1})
        image = torch.rand(2, 3, 64, 64)
        expected = model.decode(model.moments(image)[0])
        expected.square().mean().backward()
        gradient = model.encoder.conv_in.weight.grad.clone()
        model.zero_grad()
        model.to(memory_format=torch.channels_last)
        with torch.autocast("cpu", dtype=torch.bfloat16):
            result = model.decode(model.moments(image.contiguous(memory_format=torch.channels_last))[0])
        result.float().square().mean().backward()
        self.assertLess(float((result - expected).norm() / expected.norm()), 0.1)
        self.assertLess(float((model.encoder.conv_in.weight.grad - gradient).norm() / gradient.norm()), 0.2)


if __name__ == "__main__":
    unittest.main()
