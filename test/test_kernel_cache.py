# SPDX-License-Identifier: Apache-2.0
"""The kernel cache: edited sources are compiled again, old entries removed, Ctrl-C ends it."""
import ast
import io
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from numba.core.codegen import JITCodeLibrary

import uav_task_alloc
from uav_task_alloc import kernel_cache
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.kernel_cache import CompilationNotice, KernelWork, kernel_sources, sources_hash
from uav_task_alloc.kernel_inner import replaces_known_methods

PACKAGE = Path(uav_task_alloc.__file__).parent
INNER = {'inline_kernel', 'inner_kernel', 'inner_allocating_kernel'}
DECORATORS = INNER | {'kernel', 'allocating_kernel', 'intrinsic'}
CFUNCS = {'_find', '_join', '_time'}  # of geometry/scene.py
CALLEE = """
from uav_task_alloc.kernel import inline_kernel


@inline_kernel
def callee(x):
    return x + 1.0
"""
CALLER = """
from uav_task_alloc.kernel import kernel
from uav_task_alloc.solver.callee import callee


@kernel
def caller(x):
    return callee(x)


def half(x):
    return 0.5 * x
"""
CALL = 'from uav_task_alloc.solver.caller import caller; print(caller(1.0))'
FULL_DISK = """
import resource
import numba
from uav_task_alloc.kernel import c_function
from uav_task_alloc.solver.caller import caller, half
resource.setrlimit(resource.RLIMIT_FSIZE, (16, 16))
print(caller(1.0), c_function(half, numba.float64(numba.float64)).ctypes(3.0))
"""
LOAD = 'from uav_task_alloc.solver import solve; solve.load_kernels()'
PLAN = "from uav_task_alloc import __main__ as cli; cli.main(['plan', 'one.yaml'])"
SCENARIO = 'uavs: [{id: u, position: [0, 0, 50]}]\ntasks: [{id: t, position: [90, 0, 50]}]\n'
NOTICE = 'compiling kernels (once, about '


@pytest.fixture
def package(tmp_path):
    """A copy of the package without compiled kernels, with a kernel and its callee."""
    copy = tmp_path / 'uav_task_alloc'
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns('__pycache__'))
    (copy / 'solver/callee.py').write_text(CALLEE)
    (copy / 'solver/caller.py').write_text(CALLER)
    return copy


def default_sigint():
    """As in a terminal; a shell starts its background jobs with SIGINT ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def start(package, code):
    environment = {**os.environ, 'PYTHONPATH': str(package.parent), 'NUMBA_CACHE_DIR': '',
                   'PYTHONDONTWRITEBYTECODE': '1'}  # else an edit within a second is not seen
    return subprocess.Popen([sys.executable, '-c', code], env=environment, cwd=package.parent,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                            preexec_fn=default_sigint)


def output(package, code=CALL):
    """What a new process prints, and whether it compiled."""
    printed, errors = start(package, code).communicate(timeout=180.0)
    return printed.strip(), NOTICE in errors


def test_a_kernel_is_compiled_again_when_a_callee_in_another_file_was_edited(package):
    assert output(package) == ('2.0', True)
    assert output(package) == ('2.0', False)
    (package / 'solver/callee.py').write_text(CALLEE.replace('x + 1.0', 'x + 5.0'))
    assert output(package) == ('6.0', True)
    (package / 'solver/callee.py').write_text(CALLEE)
    assert output(package) == ('2.0', False)  # the earlier folder is kept for a while


def test_on_a_full_disk_kernels_are_used_though_they_cannot_be_kept(package):
    with start(package, FULL_DISK) as process:
        printed, errors = process.communicate(timeout=180.0)
    assert printed == '2.0 1.5\n', errors
    assert errors.count('compiled kernels cannot be kept on disk ([Errno 27]') == 1
    assert not list(package.rglob('*.nbc'))
    assert output(package) == ('2.0', True)


@pytest.mark.parametrize(('missing', 'on_disk'), [
    ('codegen.JITCodeLibrary', True), ('typed_passes.NativeLowering', True),
    ('caching.InTreeCacheLocator', False), ('caching.CacheImpl', False)])
def test_without_a_private_class_of_numba_kernels_are_compiled_as_numba_does(
        package, missing, on_disk):
    module, name = missing.split('.')
    hide = (f'from numba.core import {module}; import numba; del {module}.{name}; '
            f'from uav_task_alloc import kernel; print(kernel._inner_options(), kernel.ON_DISK); ')
    if on_disk:
        assert output(package, hide + CALL) == ('{} True\n2.0', True)
        assert output(package, hide + CALL) == ('{} True\n2.0', False)
    else:
        printed, errors = start(package, hide + CALL).communicate(timeout=180.0)
        assert printed.endswith(' False\n2.0\n')
        assert 'at each start: the cache of this numba is not known' in errors


def test_without_a_folder_that_can_be_written_the_variable_for_one_is_named(monkeypatch):
    bases = [type('Base', (), {'from_function': staticmethod(lambda *_: None)})]
    monkeypatch.setattr(kernel_cache, '_BASES', bases)
    with pytest.raises(InvalidValue, match=r'NUMBA_CACHE_DIR = .*: expected a folder'):
        kernel_cache.KernelCacheLocator.from_function(kernel_cache.kernel_folders, 'x.py')


def test_methods_with_other_arguments_are_not_replaced():
    changed = type('Changed', (JITCodeLibrary,), {
        'get_pointer_to_function': lambda self, name, engine: 0})
    assert replaces_known_methods()
    assert not replaces_known_methods(library=changed)
    assert not replaces_known_methods(lowering=object)


def test_folders_of_other_sources_are_removed_when_a_kernel_is_written(package):
    cache = package / 'solver/__pycache__'
    old, recent = cache / 'kernels-old', cache / 'kernels-recent'
    for folder in (old, recent):
        folder.mkdir(parents=True)
        (folder / 'search.1.nbc').touch()
    (cache / 'search.search-1.py311.nbi').touch()  # where numba puts it by default
    os.utime(old, (1e9, 1e9))
    output(package)
    folders = {folder.name for folder in cache.glob('kernels-*')}
    assert folders == {'kernels-recent', f'kernels-{sources_hash.__wrapped__(package)}'}
    assert not list(cache.glob('*.nb*'))


def compile_ten(stream):
    """Ten of twenty kernels take a second each; what is written to a stream."""
    now = [0.0]
    notice = CompilationNotice(lambda: now[0])
    with notice.shown_on(stream), notice.until_loaded('some', KernelWork(35.0, 20)):
        for i in range(11):
            event = SimpleNamespace(data={'module': 'uav_task_alloc.a', 'qualname': f'k{i}',
                                          'name': 'native_lowering [k]'})
            notice.on_start(event)
            now[0] += 1.0
            notice.on_end(event)
    return stream.getvalue().split('\r\x1b[K')


def test_a_terminal_shows_which_kernel_of_how_many_and_the_time_left(capsys):
    terminal = io.StringIO()
    terminal.isatty = lambda: True
    shown = compile_ten(terminal)
    assert shown[1] == 'compiling kernel 1 of 20, about 35 s left: k0'
    assert shown[11:] == ['compiling kernel 11 of 20, about 10 s left: k10', '']
    assert compile_ten(io.StringIO()) == ['']
    assert capsys.readouterr().err == 2 * 'compiling kernels (once, about 35 s)\n'


def compile_one(notice, name):
    event = SimpleNamespace(data={'module': 'uav_task_alloc.a', 'qualname': name,
                                  'name': 'native_lowering [k]'})
    notice.on_start(event)
    notice.on_end(event)


def test_loads_of_two_threads_are_counted_together_after_one_line(capsys):
    terminal = io.StringIO()
    terminal.isatty = lambda: True
    notice = CompilationNotice(lambda: 0.0)
    with notice.shown_on(terminal), notice.until_loaded('first', KernelWork(30.0, 3)):
        compile_one(notice, 'a')
        with notice.until_loaded('second', KernelWork(10.0, 2), KernelWork(5.0, 50), search=False):
            compile_one(notice, 'b')
        compile_one(notice, 'c')
    shown = [line.split(',')[0] for line in terminal.getvalue().split('\r\x1b[K')[1:]]
    assert shown == ['compiling kernel 1 of 3', 'compiling kernel 2 of 5',
                     'compiling kernel 3 of 5', '']
    assert capsys.readouterr().err == 'compiling kernels (once, about 30 s)\n'


def test_what_is_loaded_as_a_part_is_counted_once(capsys):
    terminal = io.StringIO()
    terminal.isatty = lambda: True
    notice = CompilationNotice(lambda: 0.0)
    with notice.shown_on(terminal), notice.until_loaded('all', KernelWork(9.0, 3), whole=True):
        for name in 'first', 'second', 'third':
            with notice.until_loaded(name, KernelWork(3.0, 1)):
                compile_one(notice, name)
    shown = [line.split(',')[0] for line in terminal.getvalue().split('\r\x1b[K')[1:]]
    assert shown == [*(f'compiling kernel {k} of 3' for k in (1, 2, 3)), '']
    assert capsys.readouterr().err == 'compiling kernels (once, about 9 s)\n'


def test_kernels_compiled_before_the_first_load_need_no_second_line(capsys):
    notice = CompilationNotice(lambda: 0.0)
    compile_one(notice, 'zones of the random arrivals of a scenario')
    for name in 'first', 'second':
        with notice.until_loaded(name, KernelWork(3.0, 1)):
            compile_one(notice, name)
    assert capsys.readouterr().err.count('compiling kernels (once, about') == 2


@pytest.mark.parametrize(('written', 'code', 'status'), [
    (0, LOAD, -signal.SIGINT), (4, LOAD, -signal.SIGINT), (2, PLAN, 130)])
def test_ctrl_c_ends_a_compilation_at_once(package, written, code, status):
    (package.parent / 'one.yaml').write_text(SCENARIO)
    with start(package, code) as process:
        assert process.stderr.readline().startswith(NOTICE)
        while len(list(package.rglob('*.nbc'))) < written:
            assert process.poll() is None
            time.sleep(0.01)
        process.send_signal(signal.SIGSTOP)  # it compiles nothing between the count and Ctrl-C
        os.waitid(os.P_PID, process.pid, os.WSTOPPED | os.WNOWAIT)
        before = set(package.rglob('*.nbc'))
        process.send_signal(signal.SIGINT)
        process.send_signal(signal.SIGCONT)
        assert process.wait(timeout=90.0) == status
    assert set(package.rglob('*.nbc')) == before


def test_ctrl_c_raises_keyboard_interrupt_after_a_compilation(package):
    code = f'{CALL}\nimport signal\ntry:\n    signal.raise_signal(signal.SIGINT)\n' \
           "except KeyboardInterrupt:\n    print('raised')"
    assert output(package, code) == ('2.0\nraised', True)


def test_comments_and_docstrings_do_not_change_the_hash_but_code_does(package):
    source, before = package / 'solver/search.py', sources_hash.__wrapped__(package)
    text = source.read_text()
    source.write_text('# a comment\n' + text.replace('"""Anneal r', '"""Anneal routes r'))
    assert sources_hash.__wrapped__(package) == before
    source.write_text(text.replace('log.counts[4] -= 1', 'log.counts[4] -= 2'))
    assert sources_hash.__wrapped__(package) != before


def decorated(tree, decorators=frozenset(DECORATORS)):
    """Functions of a module that are compiled."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and any(
                isinstance(each, ast.Name) and each.id in decorators
                for each in node.decorator_list):
            yield node


@pytest.mark.parametrize('path', kernel_sources(), ids=lambda p: p.relative_to(PACKAGE).as_posix())
def test_kernels_use_only_names_from_hashed_sources(path):
    tree = ast.parse(path.read_text())
    hashed = {'.'.join(each.relative_to(PACKAGE.parent).with_suffix('').parts)
              for each in kernel_sources()}
    other = {alias.asname or alias.name for node in tree.body if isinstance(node, ast.ImportFrom)
             if node.module.startswith('uav_task_alloc') and node.module not in hashed
             for alias in node.names if f'{node.module}.{alias.name}' not in hashed}
    used = {node.id for function in decorated(tree) for statement in function.body
            for node in ast.walk(statement) if isinstance(node, ast.Name)}
    assert used & other == set()


def test_every_kernel_is_compiled_by_the_decorators_of_kernel_py():
    direct = [path.name for path in PACKAGE.rglob('*.py')
              if 'njit' in path.read_text() and path.name != 'kernel.py']
    assert direct == []


def test_an_inner_kernel_called_from_python_is_compiled_for_that_once(package):
    code = 'from uav_task_alloc.solver.callee import callee; print(callee(1.0))'
    assert output(package) == ('2.0', True)
    assert output(package, code) == ('2.0', True)
    assert output(package, code) == ('2.0', False)


def test_python_code_of_the_package_calls_no_inner_kernel():
    trees = {path: ast.parse(path.read_text()) for path in PACKAGE.rglob('*.py')}
    names = {'.'.join(path.relative_to(PACKAGE.parent).with_suffix('').parts): {
        each.name for each in decorated(tree, INNER)} for path, tree in trees.items()}
    assert 'find_nearest' not in names['uav_task_alloc.solver.neighbours']
    assert '_insert_sorted' in names['uav_task_alloc.solver.neighbours']
    for path, tree in trees.items():
        inner = {alias.asname or alias.name for node in tree.body
                 if isinstance(node, ast.ImportFrom) for alias in node.names
                 if alias.name in names.get(node.module, ())}
        inner |= names['.'.join(path.relative_to(PACKAGE.parent).with_suffix('').parts)]
        compiled = {node for each in decorated(tree) for node in ast.walk(each)}
        compiled |= {node for each in tree.body if getattr(each, 'name', '') in CFUNCS
                     for node in ast.walk(each)}
        called = {node.func.id for node in ast.walk(tree) if isinstance(node, ast.Call)
                  and isinstance(node.func, ast.Name) and node not in compiled}
        assert called & inner == set(), path


@pytest.mark.parametrize('room', ['geometry', 'solver'])
def test_kernels_that_python_code_does_not_call_are_inner_kernels(room):
    """Each other one is optimised and translated once more than where it is called."""
    trees = [ast.parse(path.read_text()) for path in PACKAGE.rglob('*.py')]
    used = set()
    for tree in trees:
        compiled = {node for each in decorated(tree) for node in ast.walk(each)}
        used |= {node.id for node in ast.walk(tree)
                 if isinstance(node, ast.Name) and node not in compiled}
    outer = {each.name for path in (PACKAGE / room).rglob('*.py')
             for each in decorated(ast.parse(path.read_text()), {'kernel', 'allocating_kernel'})}
    assert outer
    assert outer - used == set()
