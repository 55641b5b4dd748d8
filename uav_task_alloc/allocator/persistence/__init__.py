# SPDX-License-Identifier: Apache-2.0
"""The allocator's state in the journal, and back."""
