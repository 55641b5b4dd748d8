# SPDX-License-Identifier: Apache-2.0
"""Problems with time, loads or trips: their arrays, and the kernels that search in them."""
