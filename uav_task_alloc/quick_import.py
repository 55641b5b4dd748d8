# SPDX-License-Identifier: Apache-2.0
"""Imports the module of a program for a quarter less CPU: of short runs most is imports."""
import gc
import os
from importlib import import_module
from types import ModuleType


def import_quickly(name: str) -> ModuleType:
    """Import a module, and what it imports, without collecting garbage meanwhile.

    OpenBLAS, which numpy loads, starts no threads, unless OPENBLAS_NUM_THREADS is set: they spin,
    and no matrix of this package has enough elements for more than one.

    Args:
        name: absolute name of the module.

    Returns:
        The module.
    """
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    collects = gc.isenabled()
    gc.disable()
    try:
        return import_module(name)
    finally:
        if collects:
            gc.enable()
