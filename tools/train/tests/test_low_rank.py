# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Low-rank adapters: training them alone, what is exported, and going on from that."""
import os
import tempfile
import unittest

import numpy as np
import torch

from semtrain import safetensors_file
from semtrain.low_rank import FILE, add_low_rank, merged, read_adapter
from semtrain.model_folder import read_component, write_component
from semtrain.nets.transformer import VoxfieldTransformer
from semtrain.regenerate import load_transformer
from test_transformer import train, write_street

NETWORK = {"num_layers": 2, "num_attention_heads": 2, "attention_head_dim": 16, "points_per_voxel": 4,
           "num_classes": 20, "voxel_size": 0.6, "attention_radius": 3.0, "pos_embed_dim": 8, "context_pos_embed": True}
GIVEN = (torch.linspace(-1, 1, 120).reshape(1, 5, 24), torch.tensor([[13, 13, 0, 0, 2]]),
         torch.arange(15.0).reshape(1, 5, 3) * 0.6, torch.ones(1, 5, dtype=torch.bool), torch.tensor([300]))
ONLY = ["--set", "low_rank=2", "--set", 'low_rank_of=["transformer_blocks.*.attn.*", "proj_in"]', "--set",
        'train_only=["proj_out.bias"]']


class AnAdapter(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.grid = self.path("a.sgrid")
        write_street(self.grid)

    def tearDown(self):
        self.folder.cleanup()

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def made(self, folder):
        return self.path(f"{folder}/model/voxfield_transformer")

    def test_adds_nothing_at_first_and_is_what_is_added_to_the_weights(self):
        torch.manual_seed(1)
        model = VoxfieldTransformer(**NETWORK)
        with torch.no_grad():
            plain = model(*GIVEN)
            add_low_rank(model, 3, ["transformer_blocks.*.attn.*", "transformer_blocks.*", "proj_in"])
            self.assertTrue(torch.equal(model(*GIVEN), plain))
            for name, p in model.named_parameters():
                if ".lora_" in name:
                    self.assertEqual(3, min(p.shape), name)
                    p.normal_(std=0.1)
            adapted = model(*GIVEN)
            state = model.state_dict()
            adapter = {name: t for name, t in state.items() if ".lora_" in name}
            self.assertEqual(len(adapter), 2 * (8 + 7 + 4 + 2 + 4 + 1))  # attention, feed-forward, modulation, proj_in
            whole = VoxfieldTransformer(**NETWORK)
            whole.load_state_dict(merged({name: t for name, t in state.items() if name not in adapter}, adapter))
            torch.testing.assert_close(whole(*GIVEN), adapted, atol=1e-4, rtol=1e-4)
        self.assertGreater(float((adapted - plain).abs().max()), 0.01)
        with self.assertRaisesRegex(SystemExit, "low_rank_of: no layer is called ff"):
            add_low_rank(VoxfieldTransformer(**NETWORK), 3, ["ff"])

    def test_is_trained_while_the_weights_stay_and_lies_beside_them(self):
        train(self.grid, self.path("whole"), 20, "--set", "learning_rate=0.01", "--set", "ema=0.5")
        train(self.grid, self.path("adapted"), 4, "--init", self.made("whole"), *ONLY)
        before, after = (read_component(self.made(folder))[1] for folder in ("whole", "adapted"))
        self.assertEqual([n for n in before if not torch.equal(before[n], after[n])], ["proj_out.bias"])
        self.assertEqual(read_adapter(self.made("whole")), {})
        adapter = safetensors_file.read(os.path.join(self.made("adapted"), FILE))
        layers = {name.rsplit(".lora_", 1)[0] for name in adapter}
        self.assertEqual(len(layers), 8 + 7 + 1)
        silent = [layer for layer in layers if adapter[f"{layer}.lora_B.weight"].abs().max() == 0]
        self.assertEqual(silent, ["transformer_blocks.1.attn.add_q_proj"])  # of the last block nothing comes of it
        model = load_transformer(self.made("adapted"))
        added = adapter["proj_in.lora_B.weight"].float() @ adapter["proj_in.lora_A.weight"].float()
        torch.testing.assert_close(model.proj_in.weight, after["proj_in.weight"].float() + added)

    def test_is_gone_on_from_or_becomes_part_of_the_weights(self):
        train(self.grid, self.path("whole"), 2)
        train(self.grid, self.path("adapted"), 4, "--init", self.made("whole"), *ONLY)
        rate = ["--set", "learning_rate=1e-9", "--init", self.made("adapted")]
        train(self.grid, self.path("again"), 1, *rate, *ONLY)
        train(self.grid, self.path("merged"), 1, *rate)
        first, again = (load_transformer(self.made(folder)).state_dict() for folder in ("adapted", "again"))
        for name, tensor in first.items():
            np.testing.assert_allclose(again[name], tensor, atol=2e-4, err_msg=name)
        self.assertEqual(read_adapter(self.made("merged")), {})
        for name, tensor in load_transformer(self.made("merged")).state_dict().items():
            np.testing.assert_allclose(tensor, first[name], atol=2e-3, err_msg=name)

    def test_of_an_older_training_does_not_stay_beside_new_weights(self):
        weights = {"a.weight": torch.ones(2, 3)}
        write_component(self.path("m"), {}, {**weights, "a.lora_A.weight": torch.ones(1, 3),
                                             "a.lora_B.weight": torch.ones(2, 1)})
        self.assertEqual(len(read_adapter(self.path("m"))), 2)
        write_component(self.path("m"), {}, weights)
        self.assertEqual(read_adapter(self.path("m")), {})


if __name__ == "__main__":
    unittest.main()
