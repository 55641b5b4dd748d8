# SPDX-License-Identifier: Apache-2.0
"""Outputs and packages are checked before a command computes; an error names the option."""
import errno
import importlib.util
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from uav_task_alloc import __main__ as cli
from uav_task_alloc.atomic_files import replacing
from uav_task_alloc.cli import outputs, plan

ROOT = Path(__file__).parents[2]
FILE = str(ROOT / 'config/scenarios/plan_only.yaml')
NOBODY = 65534  # user id


@pytest.fixture
def no_solver(monkeypatch):
    """A command that begins to compute fails."""
    def refuse(*_, **__):
        pytest.fail('computed before the outputs were checked')
    monkeypatch.setattr('uav_task_alloc.solver.solve.load_kernels', refuse)
    monkeypatch.setattr('uav_task_alloc.study.campaign.run_campaign', refuse)


BENCH = ['bench', '--sizes', '1x1', '--against', 'none']


@pytest.mark.parametrize(('arguments', 'text'), [
    (['plan', FILE, '--json', 'none/plan.json'],
     "--json = 'none/plan.json': expected a file in a folder that exists, not none"),
    (['plan', FILE, '--json', '.'], "--json = '.': expected a file, and this is a folder"),
    (['plan', FILE, '--json', 'other.yaml'],
     "--json = 'other.yaml': expected a name that does not end with .yaml, as scenarios and"),
    ([*BENCH, '--json', 'g.png', '--plot', 'g.png'], 'another file than the command uses'),
    (['plan', FILE, '--json', 'x' * 300], ': expected a place that can be written: File name too'),
    (['plan', FILE, '--plot', 'map.bmp'],
     "--plot = 'map.bmp': expected a name that ends with .png or .pdf or .svg"),
    (['plan', FILE, '--plot-3d', 'none/map.png'], "--plot-3d = 'none/map.png': expected a file"),
    (['plan', FILE, '--missions', FILE], f"--missions = '{FILE}': expected a place that can be"),
    (['plan', FILE, '--missions', f'{FILE}/m'], "plan_only.yaml/m': expected a place that can"),
    ([*BENCH, '--json', 'none/x'], "--json = 'none/x': expected a file in a folder that exists"),
    ([*BENCH, '--plot', 'x.txt'], "--plot = 'x.txt': expected a name that ends with .png or"),
    ([*BENCH, '--keep', FILE], f"--keep = '{FILE}': expected a place that can be written"),
    (['plan', FILE, '--plot', 'g.png', '--plot-times', './g.png'],
     "--plot-times = 'g.png': expected another file than the command uses otherwise"),
    (['plan', FILE, '--terrain-clearance', '50'],
     '--terrain-clearance = 50.0: expected --terrain with the ground, too'),
    (['import', '.'], "FILE = '.': expected a file, and this is a folder"),
    (['import', 'a.csv', '--fleet', FILE, '--uavs', '4'], '--uavs = 4: expected either it or'),
    (['study', '--out', FILE], f"--out = '{FILE}': expected a place that can be written"),
])
def test_an_output_that_cannot_be_written_is_refused_first(
        arguments, text, no_solver, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(arguments) == 1
    refusal = capsys.readouterr().err
    assert text in refusal
    assert refusal.count('\n') == 1
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def read_only_folder():
    """A folder that this process may not write to; root, who may, is another user meanwhile."""
    with tempfile.TemporaryDirectory() as name:  # others may not enter tmp_path of root
        user = os.geteuid()
        Path(name).chmod(0o555)
        if user == 0:
            os.seteuid(NOBODY)
        yield Path(name)
        os.seteuid(user)
        Path(name).chmod(0o700)


def test_a_folder_that_is_read_only_is_refused(read_only_folder):
    with pytest.raises(outputs.InvalidValue, match='Permission denied'):
        outputs.check_file('--json', read_only_folder / 'plan.json')
    assert list(read_only_folder.iterdir()) == []


def test_a_file_that_is_there_is_checked_and_left_as_it_is(tmp_path):
    path = tmp_path / 'plan.json'
    path.write_text('old')
    outputs.check_file('--json', path)
    assert path.read_text() == 'old'


def test_the_dash_of_other_programs_makes_no_file_of_that_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(outputs.InvalidValue, match=r"--json = '-': expected .* /dev/stdout is"):
        outputs.check_file('--json', Path('-'))
    outputs.check_file('--json', Path('./-x'))


def test_a_pipe_and_a_device_are_accepted(tmp_path):
    os.mkfifo(tmp_path / 'pipe')
    outputs.check_file('--json', tmp_path / 'pipe')
    outputs.check_file('--json', Path('/dev/stdout'))


@pytest.mark.parametrize(('arguments', 'package', 'text'), [
    (['plan', FILE, '--plot', 'x.png'], 'matplotlib', "--plot: matplotlib is not installed: "
     "expected pip install '.[plot]' in the folder of uav_task_alloc"),
    (['plan', FILE, '--missions', 'm'], 'pymavlink', '--missions: pymavlink is not installed: '
     'expected pip install . in the folder of uav_task_alloc'),
    ([*BENCH, '--plot', 'x.png'], 'matplotlib', "pip install '.[plot]'"),
    (['report', 'x.mcap'], 'mcap', "report: mcap is not installed: expected pip install '.[view"),
    (['report', 'x.mcap'], 'plotly', "pip install '.[view]'"),
])
def test_a_missing_package_is_named_with_what_installs_it(
        arguments, package, text, no_solver, monkeypatch, tmp_path, capsys):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, 'find_spec',
                        lambda name, *_: None if name == package else find(name))
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'x.mcap').touch()
    assert cli.main(arguments) == 1
    assert text in capsys.readouterr().err


def test_a_missing_package_of_the_core_is_one_line():
    code = ('import sys; sys.modules["numba"] = None; from uav_task_alloc.__main__ import main; '
            'sys.exit(main(["bench"]))')
    done = subprocess.run([sys.executable, '-c', code], cwd=ROOT, capture_output=True, text=True,
                          check=False)
    assert (done.returncode, done.stderr) == (
        1,
        'bench: numba is not installed: expected pip install . in the folder of uav_task_alloc\n')


def test_each_extra_that_an_error_names_is_in_setup_py():
    source = (ROOT / 'setup.py').read_text()
    for package, extra in outputs.EXTRAS.items():
        line = source.partition(f"'{extra}': [")[2].partition(']')[0]
        assert f"'{package.replace('_ros2', '-ros2-support')}'" in line


def run_program(*arguments, **options):
    env = {key: value for key, value in os.environ.items() if key != 'PYTHONUNBUFFERED'}
    return subprocess.run([sys.executable, '-m', 'uav_task_alloc', *arguments], cwd=ROOT, env=env,
                          stderr=subprocess.PIPE, text=True, check=False, **options)


@pytest.mark.parametrize('option', [['--json', '/dev/full'], ['--missions', 'DIR']])
def test_a_full_disk_names_the_option(option, tmp_path):
    if option[1] == 'DIR':
        option = ['--missions', str(tmp_path)]
        for name in ('scout', 'lifter', 'relay'):
            (tmp_path / f'{name}.plan').symlink_to('/dev/full')
    done = run_program('plan', FILE, '--budget', '0.02', *option, stdout=subprocess.PIPE)
    assert done.returncode == 1
    assert done.stderr == (f"{option[0]} = '{option[1]}': expected a place that can be written: "
                           'No space left on device\n')
    assert '5 tasks planned' in done.stdout


@pytest.fixture
def small_disk(monkeypatch):
    """Once it is called, files that `plan` writes may have 200 bytes; Python caches no modules."""
    write = plan.write_outputs

    def limited(*arguments):
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (200, before[1]))
        try:
            write(*arguments)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
    monkeypatch.setattr(sys, 'dont_write_bytecode', True)
    return lambda: monkeypatch.setattr(plan, 'write_outputs', limited)


@pytest.mark.parametrize(('option', 'name'), [
    ('--json', 'plan.json'), ('--plot', 'map.png'), ('--plot-3d', 'map.svg'),
    ('--plot-times', 'map.pdf'), ('--map', 'map.kml'), ('--map', 'map.geojson'),
    ('--map', 'map.plan'), ('--missions', 'scout.plan')])
def test_a_result_that_does_not_fit_leaves_the_file_as_it_was(
        option, name, small_disk, tmp_path, capsys):
    path = tmp_path / name
    given = tmp_path if option == '--missions' else path
    arguments = ['plan', FILE, '--budget', '0.02', option, str(given)]
    assert cli.main(arguments) == 0  # what it imports and compiles is in files
    for each in tmp_path.iterdir():
        each.write_text('of before')
    before = sorted(tmp_path.iterdir())
    small_disk()
    assert cli.main(arguments) == 1
    assert capsys.readouterr().err.splitlines()[-1] == (
        f"{option} = '{given}': expected a place that can be written: File too large")
    assert path.read_text() == 'of before'
    assert sorted(tmp_path.iterdir()) == before


def test_a_result_keeps_the_mode_of_the_file_that_it_replaces(tmp_path):
    path = tmp_path / 'plan.json'
    path.write_text('old')
    path.chmod(0o640)
    with replacing(path) as file:
        file.write_text('new')
        assert path.read_text() == 'old'
    assert (path.read_text(), path.stat().st_mode & 0o777) == ('new', 0o640)
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_is_a_mount_point_is_overwritten(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(errno.EBUSY, 'Device or resource busy')

    path = tmp_path / 'plan.json'
    path.write_text('old')
    monkeypatch.setattr(os, 'replace', refuse)
    with replacing(path) as file:
        file.write_text('new')
        assert path.read_text() == 'old'
    assert path.read_text() == 'new'
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_stays_a_link_to_the_file_that_is_written(tmp_path):
    (tmp_path / 'link.json').symlink_to('plan.json')
    with replacing(tmp_path / 'link.json') as file:
        file.write_text('new')
    assert (tmp_path / 'link.json').is_symlink()
    assert (tmp_path / 'plan.json').read_text() == 'new'


def _write_half(file):
    file.write_text('half')
    raise ZeroDivisionError


def test_a_result_that_fails_leaves_the_file_that_a_link_leads_to(tmp_path):
    (tmp_path / 'far').mkdir()
    (tmp_path / 'far/plan.json').write_text('old')
    (tmp_path / 'near.json').symlink_to('far/plan.json')
    (tmp_path / 'link.json').symlink_to(tmp_path / 'near.json')
    with pytest.raises(ZeroDivisionError), replacing(tmp_path / 'link.json') as file:
        _write_half(file)
    assert (tmp_path / 'link.json').read_text() == 'old'
    with replacing(tmp_path / 'link.json') as file:
        file.write_text('new')
    assert (tmp_path / 'link.json').is_symlink()
    assert (tmp_path / 'near.json').is_symlink()
    assert (tmp_path / 'far/plan.json').read_text() == 'new'
    assert [each.name for each in (tmp_path / 'far').iterdir()] == ['plan.json']


def test_a_result_for_standard_output_goes_behind_what_a_file_has_of_it(tmp_path):
    script = ('from pathlib import Path; from uav_task_alloc.atomic_files import replacing\n'
              "with replacing(Path('/dev/stdout')) as file:\n"
              "    with file.open('a') as stream:\n        stream.write('result')")
    (tmp_path / 'out').write_text('printed ')
    with (tmp_path / 'out').open('a') as out:
        subprocess.run([sys.executable, '-c', script], stdout=out, cwd=ROOT, check=True)
    assert (tmp_path / 'out').read_text() == 'printed result'


def test_links_that_lead_to_one_another_are_an_error(tmp_path):
    (tmp_path / 'a').symlink_to('b')
    (tmp_path / 'b').symlink_to('a')
    with pytest.raises(OSError, match='symbolic links'), replacing(tmp_path / 'a') as file:
        file.write_text('new')


KILLED = """
import os, signal, sys
from pathlib import Path
from uav_task_alloc.atomic_files import replacing
with replacing(Path(sys.argv[1])) as file:
    file.write_text('half')
    if sys.argv[2] == 'killed':
        os.kill(os.getpid(), signal.SIGKILL)
    print('writes', flush=True)
    sys.stdin.read()
"""


def test_what_killed_processes_have_left_is_removed_and_what_others_write_is_not(tmp_path):
    path = tmp_path / 'plan.json'
    path.write_text('old')
    for _ in range(3):
        subprocess.run([sys.executable, '-c', KILLED, str(path), 'killed'], cwd=ROOT)
    left = set(tmp_path.iterdir()) - {path}
    assert len(left) >= 1
    assert path.read_text() == 'old'
    with subprocess.Popen([sys.executable, '-c', KILLED, str(tmp_path / 'map.svg'), 'waits'],
                          stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT) as other:
        other.stdout.readline()
        with replacing(path) as file:
            file.write_text('new')
        assert not left & set(tmp_path.iterdir())
        assert path.read_text() == 'new'
        other.communicate()
    assert (tmp_path / 'map.svg').read_text() == 'half'
    assert sorted(each.name for each in tmp_path.iterdir()) == ['map.svg', 'plan.json']


def test_a_file_in_a_folder_that_is_read_only_is_written(read_only_folder):
    user = os.geteuid()
    if user == NOBODY:  # the fixture is root otherwise
        os.seteuid(0)
    path = read_only_folder / 'plan.json'
    read_only_folder.chmod(0o755)
    path.write_text('old')
    path.chmod(0o666)
    read_only_folder.chmod(0o555)
    os.seteuid(user)
    with outputs.writing('--json', path) as file:
        file.write_text('new')
    assert path.read_text() == 'new'


def test_a_full_disk_for_the_printed_plan_is_one_line():
    with open('/dev/full', 'w') as full:
        done = run_program('plan', FILE, '--budget', '0.02', stdout=full)
    assert (done.returncode, done.stderr) == (1, 'output: No space left on device\n')


@pytest.mark.parametrize('arguments', [['params'], ['-h'], ['plan', '-h'], []], ids=str)
def test_a_reader_that_goes_away_ends_the_program_silently(arguments):
    reader, writer = os.pipe()
    os.close(reader)
    done = run_program(*arguments, stdout=writer)
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, '')


def test_files_are_written_also_where_nobody_reads_the_printed_plan(tmp_path):
    reader, writer = os.pipe()
    os.close(reader)
    done = run_program('plan', FILE, '--budget', '0.02', '--json', str(tmp_path / 'plan.json'),
                       stdout=writer)
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, '')
    assert (tmp_path / 'plan.json').stat().st_size > 1000


@pytest.mark.parametrize('stream', ['1', '2'])
def test_a_stream_that_the_shell_has_closed_is_no_error(stream):
    done = subprocess.run(
        ['sh', '-c', f'exec "$0" -m uav_task_alloc plan {FILE} --budget 0.02 {stream}>&-',
         sys.executable], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, '')
