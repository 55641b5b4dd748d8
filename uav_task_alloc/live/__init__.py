# SPDX-License-Identifier: Apache-2.0
"""The live page in the browser: what is shown (scene), since when (board), and how (server)."""
