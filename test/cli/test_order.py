# SPDX-License-Identifier: Apache-2.0
"""The command `order` without ROS: its arguments, and a clear word where ROS is missing."""

import pytest

from uav_task_alloc.cli import order
from uav_task_alloc.cli.commands import main


@pytest.mark.parametrize(('argv', 'text'), [
    (['pin', 't1'], "pin: 't1': expected TASK UAV"),
    (['pause', 'a', 'b'], "pause: 'a b': expected UAV"),
    (['accept', 'x'], "accept: 'x': expected the revision of a proposal"),
    (['land', 'a'], "'land'"),
    (['pin', 't1', 'a', '--why'], '--why'),
    (['pause', 'a', '--clear'], '--clear: expected with pin or forbid, not pause'),
    (['return', 'a', '--clear'], '--clear: expected with pin or forbid, not return'),
    (['pin', 't1', 'a', '--keep-tasks'], '--keep-tasks: expected with pause, not pin'),
])
def test_malformed_arguments_are_one_line(argv, text, capsys):
    with pytest.raises(SystemExit) as caught:
        order.main(argv)
    assert caught.value.code == 2
    assert text in capsys.readouterr().err


def test_without_ros_it_says_what_is_needed(monkeypatch, capsys):
    def missing(name):
        raise ModuleNotFoundError("No module named 'rclpy'", name='rclpy')

    monkeypatch.setattr(order, 'import_module', missing)
    assert main(['order', 'pin', 't1', 'a']) == 1
    assert capsys.readouterr().err == (
        'order: rclpy cannot be imported: it talks to a running allocator, and needs ROS 2 '
        'Jazzy, sourced, with this package built in it\n')


def test_the_log_of_a_folder_without_a_journal_is_an_error(tmp_path, capsys):
    assert main(['order', 'log', str(tmp_path / 'none')]) == 1
    assert 'none' in capsys.readouterr().err
