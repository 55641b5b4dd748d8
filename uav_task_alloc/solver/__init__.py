# SPDX-License-Identifier: Apache-2.0
"""How tasks are shared out: problem arrays, construction, the chain-Q bee learner, search."""
