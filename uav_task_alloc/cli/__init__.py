# SPDX-License-Identifier: Apache-2.0
"""The commands of `uav_task_alloc`: one file each, with its `main(argv)`."""
