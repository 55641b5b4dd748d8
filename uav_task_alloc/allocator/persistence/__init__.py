# SPDX-License-Identifier: Apache-2.0
"""The state of the allocator in the journal, and back."""
