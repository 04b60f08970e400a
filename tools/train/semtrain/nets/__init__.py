# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The networks, with the names that diffusers gives their tensors (docs/models.md); checked against golden cases."""
