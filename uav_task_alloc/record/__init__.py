# SPDX-License-Identifier: Apache-2.0
"""Records of a run: messages of the nodes (run_state, bag) and true tracks (ground_truth)."""
