# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Recipes that train what semrover runs; PyTorch 1.13 (Debian 12) or later, on a CPU or CUDA."""
