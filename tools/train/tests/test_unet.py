# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
import unittest

import torch

from golden import apart, load_network, read_case
from semtrain.nets.unet import UNet2DConditionModel


class UnetGivesWhatTheReferenceGives(unittest.TestCase):
    def check(self, name):
        case, tensors = read_case(name)
        model = load_network(UNet2DConditionModel, name)
        traced = {}

        def keep(key):
            return lambda module, inputs, output: traced.__setitem__(key, output)
        model.down_blocks[0].resnets[0].register_forward_hook(keep("down0.resnet0"))
        model.down_blocks[0].attentions[0].register_forward_hook(keep("down0.attention0"))
        model.mid_block.register_forward_hook(keep("mid"))
        with torch.no_grad():
            result = model(tensors["input.sample"], tensors["input.timestep"], tensors["input.encoder_hidden_states"])
        self.assertLess(apart(result, tensors["expect.sample"]), case["tolerance"]["fp32"])
        for key, value in traced.items():
            self.assertLess(apart(value, tensors["trace." + key]), case["tolerance"]["fp32"], key)

    def test_of_a_batch_of_thirteen_channels(self):
        self.check("unet_asd_tiny")

    def test_of_a_size_that_does_not_halve_evenly(self):
        self.check("unet_odd_tiny")

    def test_blocks_with_attention_may_stand_anywhere(self):
        model = UNet2DConditionModel({
            "in_channels": 13, "block_out_channels": [8, 16, 24], "layers_per_block": [1, 2, 1], "norm_num_groups": 4,
            "down_block_types": ["DownBlock2D", "CrossAttnDownBlock2D", "DownBlock2D"],
            "up_block_types": ["CrossAttnUpBlock2D", "UpBlock2D", "UpBlock2D"], "mid_block_type": "UNetMidBlock2D",
            "attention_head_dim": [1, 2, 3], "cross_attention_dim": 8})
        self.assertEqual(len(model.mid_block.resnets), 1)
        out = model(torch.zeros(2, 13, 7, 9), torch.tensor([3, 900]), torch.zeros(1, 1, 8))
        self.assertEqual(tuple(out.shape), (2, 4, 7, 9))

    def test_in_bf16_with_channels_last_it_gives_nearly_the_same(self):
        torch.manual_seed(1)
        model = UNet2DConditionModel({
            "block_out_channels": [16, 32], "layers_per_block": 1, "norm_num_groups": 8, "attention_head_dim": 2,
            "down_block_types": ["DownBlock2D", "CrossAttnDownBlock2D"], "cross_attention_dim": 8,
            "up_block_types": ["CrossAttnUpBlock2D", "UpBlock2D"]})
        sample, time, text = torch.randn(2, 4, 20, 30), torch.tensor([10, 600]), torch.randn(1, 1, 8)
        expected = model(sample, time, text)
        expected.square().mean().backward()
        gradient = model.conv_in.weight.grad.clone()
        model.zero_grad()
        model.to(memory_format=torch.channels_last)
        with torch.autocast("cpu", dtype=torch.bfloat16):
            result = model(sample.contiguous(memory_format=torch.channels_last), time, text)
        result.float().square().mean().backward()
        self.assertLess(float((result - expected).norm() / expected.norm()), 0.1)
        self.assertLess(float((model.conv_in.weight.grad - gradient).norm() / gradient.norm()), 0.2)


if __name__ == "__main__":
    unittest.main()
