# SPDX-License-Identifier: Apache-2.0
"""The variables of SROS 2, checked: ROS runs without security where they are incomplete."""
from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

from uav_task_alloc.errors import InvalidValue

_ENABLE, _STRATEGY, _KEYSTORE = (
    'ROS_SECURITY_ENABLE', 'ROS_SECURITY_STRATEGY', 'ROS_SECURITY_KEYSTORE')
_OVERRIDE = 'ROS_SECURITY_ENCLAVE_OVERRIDE'
_UNSECURED = 'this node runs without security'
_ENFORCE = 'Enforce'


def security_warning(environment: Mapping[str, str], enclave: str) -> str:
    """Say where a node that is to be secured is not.

    Args:
        environment: variables of the process.
        enclave: of the node, '/' where none is given.

    Returns:
        '' where it is as the variables say.

    Raises:
        InvalidValue: it may not run without security, and has no keys.
    """
    enabled, strategy = environment.get(_ENABLE, ''), environment.get(_STRATEGY, '')
    if enabled not in ('', 'true', 'false'):
        return f'{_ENABLE} = {enabled!r}: expected true or false: {_UNSECURED}'
    if enabled != 'true':
        return ''
    keystore = environment.get(_KEYSTORE, '')
    folder = Path(f'{keystore}/enclaves/{environment.get(_OVERRIDE) or enclave}')
    if not keystore:
        error = InvalidValue(_KEYSTORE, keystore,
                             f'the folder of a keystore, as {_ENABLE} is true')
    elif not folder.is_dir():
        error = InvalidValue(_KEYSTORE, keystore, f'the keys of this node in {folder} (the '
                             'enclave is given by --ros-args --enclave)')
    elif strategy not in ('', _ENFORCE, 'Permissive'):
        return (f'{_STRATEGY} = {strategy!r}: expected {_ENFORCE} or Permissive: other nodes '
                'may run without security')
    else:
        return ''
    if strategy == _ENFORCE:
        raise error
    return f'{error}: {_UNSECURED}, as {_STRATEGY} is not {_ENFORCE}'


def enclave_of(argv: list[str]) -> str:
    """Return the enclave on a command line, '/' where none is given.

    Args:
        argv: the command line, which ROS can read.
    """
    given = [word for flag, word in pairwise(argv)
             if flag in ('-e', '--enclave')]
    return given[-1] if '--ros-args' in argv and given else '/'
