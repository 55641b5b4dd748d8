# SPDX-License-Identifier: Apache-2.0
"""The command `order`: orders of an operator to a running allocator, and the log of them."""
from __future__ import annotations

import getpass
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from importlib import import_module

from uav_task_alloc.allocator.persistence.restore import restored_state
from uav_task_alloc.cli.options import OptionParser
from uav_task_alloc.errors import AllocError, InvalidValue
from uav_task_alloc.journal_recovery import read_copy

_CLIENT = 'uav_task_alloc.nodes.order_client'  # needs ROS 2
_EPILOG = """actions:
  pin TASK UAV         only this UAV may fly the task
  forbid TASK UAV      this UAV may not fly the task
  next UAV TASK ...    the UAV flies these tasks next, in this order; its others follow freely
  pause UAV            the UAV holds where it is, and others get its tasks (--keep-tasks: not)
  resume UAV           ends a pause or a return; it is no hand-over
  return UAV           the UAV flies home, and others get its tasks
  return all           all UAVs fly home
  undo ORDER           takes an order back
  accept REVISION      the proposed plan of this revision comes into force
  reject REVISION      it does not
  log STATE_DIR        prints who ordered what, from the state_dir of an allocator
"""


@dataclass(frozen=True, slots=True)
class _Action:
    service: str  # of the allocator
    most: int  # names that follow, at most
    names: str  # what they are
    least: int = 1  # names that follow, at least


_ACTIONS = {
    'pin': _Action('pin_task', 2, 'TASK UAV', 2),
    'forbid': _Action('forbid_task', 2, 'TASK UAV', 2),
    'next': _Action('order_tasks', 101, 'UAV TASK ...'), 'pause': _Action('pause_uav', 1, 'UAV'),
    'resume': _Action('resume_uav', 1, 'UAV'), 'return': _Action('return_uav', 1, 'UAV'),
    'undo': _Action('undo_order', 1, 'ORDER'), 'accept': _Action('approve_plan', 1, 'REVISION'),
    'reject': _Action('approve_plan', 1, 'REVISION'), 'log': _Action('', 1, 'STATE_DIR')}


class NoRos(AllocError):
    """The command needs ROS 2, which is not installed or not sourced."""


def main(argv: Sequence[str]) -> int:
    """Give an order; print what was done, or why it was refused.

    Returns:
        0 where it is in force, or could be; 1 where it was refused.

    Raises:
        InvalidValue: an option is out of its range.
        NoRos: ROS 2 is not there.
        SystemExit: the arguments are malformed, or ask for the help.
    """
    parser = _parser()
    args = parser.parsed(argv)
    action = _ACTIONS[args.action]
    if not action.least <= len(args.names) <= action.most:
        parser.error(f"{args.action}: {' '.join(args.names)!r}: expected {action.names}")
    for given, option, actions in ((args.clear, '--clear', ('pin', 'forbid')),
                                   (args.keep_tasks, '--keep-tasks', ('pause',))):
        if given and args.action not in actions:
            parser.error(f'{option}: expected with {" or ".join(actions)}, not {args.action}')
    if args.action == 'log':
        return _print_log(args.names[0])
    if args.action in ('accept', 'reject') and not args.names[0].isdecimal():
        parser.error(f'{args.action}: {args.names[0]!r}: expected the revision of a proposal')
    request: dict[str, object] = {
        'operator_name': args.operator, 'dry_run': args.dry_run, 'revision': args.revision,
        **_fields(args.action, args.names)}
    request |= {'clear': True} if args.clear else {}
    request |= {'keep_tasks': args.keep_tasks} if args.action == 'pause' else {}
    try:
        client = import_module(_CLIENT)
    except ImportError as error:
        raise NoRos(f'order: {error.name or "rclpy"} cannot be imported: it talks to a running '
                    'allocator, and needs ROS 2 Jazzy, sourced, with this package built in it'
                    ) from None
    success, text = client.call(args.allocator, action.service, request, args.timeout)
    print(text, file=sys.stdout if success else sys.stderr)
    return 0 if success else 1


def _parser() -> OptionParser:
    parser = OptionParser('order', 'Give an order to a running allocator (docs/operator.md).',
                          _EPILOG)
    parser.add_argument('action', choices=_ACTIONS, metavar='ACTION',
                        help='what to order, as listed below')
    parser.add_argument('names', nargs='*', metavar='NAME', help='of tasks, UAVs, orders')
    parser.add_argument('--dry-run', action='store_true',
                        help='only print what it would cost (default: give the order)')
    parser.add_argument('--clear', action='store_true',
                        help='of pin and forbid: end that order instead (default: begin it)')
    parser.add_argument('--keep-tasks', action='store_true',
                        help='of pause: its tasks wait for the UAV (default: others get them)')
    parser.add_argument('--operator', default=_user(), metavar='NAME',
                        help='who orders, for the log (default: %(default)s)')
    parser.add_argument('--allocator', default='/allocator', metavar='NODE',
                        help='name of the node (default: %(default)s)')
    parser.number('--revision', 0, 2**32 - 1, 'refuse where another allocation is in force; 0: '
                  'any', default=0, whole=True)
    parser.number('--timeout', 0.1, 3600.0, 'of the answer', unit='s', default=10.0)
    return parser


def _fields(action: str, names: Sequence[str]) -> Mapping[str, object]:
    """What the request of an action has besides the common fields."""
    if action in ('pin', 'forbid'):
        return {'task_id': names[0], 'uav_id': names[1]}
    if action == 'next':
        return {'uav_id': names[0], 'task_ids': list(names[1:])}
    if action in ('accept', 'reject'):
        return {'revision': int(names[0]), 'accept': action == 'accept'}
    if action == 'undo':
        return {'order_id': names[0]}
    return {'uav_id': '' if (action, names[0]) == ('return', 'all') else names[0]}


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return 'unnamed'


def _print_log(state_dir: str) -> int:
    rows = read_copy(state_dir)
    if not rows:
        raise InvalidValue('STATE_DIR', state_dir, 'the state_dir of an allocator that has run')
    for entry in sorted(restored_state(rows).orders.log, key=lambda entry: entry.number):
        at = datetime.fromtimestamp(entry.stamp, timezone.utc).strftime('%Y-%m-%dT%H:%M:%SZ')
        print(f'{at}  {entry.operator or "-"}  {entry.text}')
    return 0
