# SPDX-License-Identifier: Apache-2.0
"""Programs import without collecting garbage and without threads of OpenBLAS."""
import gc
import os
import subprocess
import sys

import pytest

from uav_task_alloc import quick_import
from uav_task_alloc.cli import commands
from uav_task_alloc.errors import AllocError

SEEN = "import gc, os\nseen = gc.isenabled(), os.environ['OPENBLAS_NUM_THREADS']\n"


@pytest.fixture
def module(tmp_path, monkeypatch):
    """module(text) -> name of a new module with that text."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delenv('OPENBLAS_NUM_THREADS', raising=False)

    def write(text):
        (tmp_path / 'imported_once.py').write_text(text)
        return 'imported_once'
    yield write
    sys.modules.pop('imported_once', None)


@pytest.mark.parametrize(('given', 'used'), [(None, '1'), ('2', '2')])
def test_nothing_is_collected_while_it_imports(module, monkeypatch, given, used):
    if given:
        monkeypatch.setenv('OPENBLAS_NUM_THREADS', given)
    assert gc.isenabled()
    assert quick_import.import_quickly(module(SEEN)).seen == (False, used)
    assert gc.isenabled()


def test_garbage_is_collected_again_after_a_failed_import(module):
    with pytest.raises(ZeroDivisionError):
        quick_import.import_quickly(module('1 / 0'))
    assert gc.isenabled()


def test_a_process_that_does_not_collect_is_left_so(module):
    gc.disable()
    try:
        quick_import.import_quickly(module(SEEN))
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_commands_are_imported_so(monkeypatch, capsys):
    def refuse(name):
        raise AllocError(name)
    monkeypatch.setattr(quick_import, 'import_quickly', refuse)
    assert commands.main(['params']) == 1
    assert capsys.readouterr().err == 'uav_task_alloc.cli.params\n'


@pytest.mark.parametrize('name', ['allocator', 'mavlink_bridge'])
def test_nodes_are_imported_so(name):
    code = f"""import sys
from uav_task_alloc import quick_import
quick_import.import_quickly = lambda name: sys.exit(f'so: {{name}}')
from uav_task_alloc.nodes.ros.start import start
start({name!r})"""
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          env=os.environ)
    assert done.stderr == f'so: uav_task_alloc.nodes.{name}\n'
