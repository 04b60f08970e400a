# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
import os
import tempfile
import unittest

import numpy as np
import torch

from semtrain import model_folder, settings


def nearest(values, bits):
    """float64 with so many bits of mantissa after the leading one, ties to even"""
    fraction, exponent = np.frexp(values)
    return np.ldexp(np.round(np.ldexp(fraction, bits + 1)), exponent - bits - 1)


class AWeightOfAModel(unittest.TestCase):
    def test_has_the_bits_of_mantissa_that_were_asked_for(self):
        codes = torch.arange(0x0400, 0x7000, dtype=torch.int16)  # normal, and far from what overflows
        half = torch.cat([codes, codes - 0x8000]).view(torch.float16)
        for bits in (10, 7, 5, 1):
            got = model_folder.rounded_half(half, bits)
            np.testing.assert_array_equal(got.double().numpy(), nearest(half.double().numpy(), bits))
        small = torch.tensor([2.0**-24, 3 * 2.0**-20, -2.0**-15, 0.0])
        self.assertLess((model_folder.rounded_half(small, 5).double() - small.double()).abs().max(), 2.0**-19)

    def test_is_written_with_them(self):
        weights = {"a": torch.randn(3, 5), "b": torch.randn(7, 2).T}
        with tempfile.TemporaryDirectory() as folder:
            model_folder.write_component(os.path.join(folder, "m"), {"x": 1}, weights, 6)
            config, got = model_folder.read_component(os.path.join(folder, "m"))
        self.assertEqual(config, {"x": 1})
        for name, tensor in weights.items():
            np.testing.assert_array_equal(got[name].double().numpy(),
                                          nearest(tensor.half().double().numpy(), 6), name)

    def test_of_bits_that_there_are_not_is_refused_before_anything_is_trained(self):
        for bits in ("0", "11", "6.0", "6.5", "many"):
            words = ["-o", "unused", "--config", "small", "--set", f"mantissa_bits={bits}"]
            with self.assertRaisesRegex(SystemExit, "mantissa_bits: expected a whole number from 1 to 10, found"):
                settings.resolve("transformer", settings.parser("transformer", "").parse_args(words))


if __name__ == "__main__":
    unittest.main()
