# SPDX-License-Identifier: Apache-2.0
"""Every command, snippet, link and quoted error of the docs is tested; see docs_pages.py."""
import ast
import importlib.util
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, suppress

import docs_commands
import launch_stand_in
import pytest
import yaml
from docs_pages import LANGUAGES, MARKS, PAGES, ROOT, blocks, prose

from uav_task_alloc import scenario
from uav_task_alloc.nodes.ros.udp_ports import free_port

BLOCKS = [block for page in PAGES for block in blocks(page)]
NO_ROS = importlib.util.find_spec('rclpy') is None
TIMEOUT = 120.0  # [s] of one block, which takes one or two on an idle machine


def by_name(page):
    return page.relative_to(ROOT).as_posix()


def needs_ros(text):
    return 'ros2 ' in text or 'rclpy' in text


class Sandbox:
    """A temporary folder like the repository, in which the blocks of a page are run.

    The ports that a page names are replaced by free ones, so that runs do not interfere.
    """

    def __init__(self, folder, stack):
        self.folder, self.stack, self.ports, self.ros_files = folder, stack, {}, []
        self.env = {**os.environ, 'PYTHONPATH': f'{ROOT}:{os.environ.get("PYTHONPATH", "")}',
                    'PATH': f'{folder / ".bin"}:{os.environ["PATH"]}', 'PYTHONUNBUFFERED': '1'}
        for path in ROOT.iterdir():
            if path.name not in ('out', 'log', '.git'):
                (folder / path.name).symlink_to(path)
        (folder / '.bin').mkdir()
        self._stand_in('python', f'exec {sys.executable} "$@"')
        self._stand_in('uav_task_alloc', f'exec {sys.executable} -m uav_task_alloc "$@"')
        if shutil.which('ros2') is None:
            self._stand_in('ros2', f'exec {sys.executable} {ROOT}/test/ros2_stand_in.py "$@"')
        if not NO_ROS:
            self._own_domain()

    def _stand_in(self, name, line):
        path = self.folder / '.bin' / name
        path.write_text(f'#!/bin/sh\n{line}\n')
        path.chmod(0o755)

    def _own_domain(self):
        import domain_coordinator
        number = self.stack.enter_context(domain_coordinator.domain_id())
        quick = ROOT / 'test/nodes/quick_discovery.xml'
        self.env |= {'ROS_DOMAIN_ID': str(number), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
                     'FASTRTPS_DEFAULT_PROFILES_FILE': str(quick)}

    def _own_port(self, match):
        return match[1] + str(self.ports.setdefault(match[2], free_port()))

    def apply(self, block):
        """Run, write or skip a block, by its mark and language."""
        if block.mark == 'file':
            path = self.folder / block.what
            assert not path.exists(), f'{block}: {block.what} is there already'
            path.write_text(block.text)
            self.ros_files += [block.what] * needs_ros(block.text)
        with_ros = needs_ros(block.text) or any(name in block.text for name in self.ros_files)
        if block.mark in ('needs', 'says', 'file') or (NO_ROS and with_ros):
            return
        if block.language == 'python':
            (self.folder / '.snippet.py').write_text(block.text)
            self.run(block, [sys.executable, '.snippet.py'])
        elif block.language == 'bash':
            text = re.sub(r'(port:=|127\.0\.0\.1:)(\d+)', self._own_port, block.text)
            words = ['bash', '-euo', 'pipefail', '-c', text]
            (self.start if block.mark == 'until' else self.run)(block, words)

    def _popen(self, words, output):
        """A process in a group of its own, which ends with this one."""
        return subprocess.Popen([sys.executable, '-IS', ROOT / 'test/ends_with_parent.py', *words],
                                cwd=self.folder, env=self.env, stdout=output,
                                stderr=subprocess.STDOUT, text=True, start_new_session=True)

    def run(self, block, words):
        """Run to the end: the status must be 0 unless the mark is `fails`."""
        with self._popen(words, subprocess.PIPE) as done:
            try:
                output, _ = done.communicate(timeout=TIMEOUT)
            finally:
                with suppress(ProcessLookupError):  # what the shell has left
                    os.killpg(done.pid, signal.SIGKILL)
        if block.mark == 'fails':
            assert done.returncode != 0, f'{block}: expected it to fail\n{output}'
            assert block.what in output, f'{block}:\n{output}'
        else:
            assert done.returncode == 0, f'{block}: status {done.returncode}\n{output}'

    def start(self, block, words):
        """Run in the background to the end of the page; it must print the text of the mark."""
        log = self.folder / f'.log_{block.line}'
        with open(log, 'w') as file:
            process = self._popen(words, file)
        self.stack.callback(self.stop, block, process, log)
        end = time.monotonic() + TIMEOUT
        while block.what not in log.read_text():
            assert process.poll() is None, f'{block}: has ended\n{log.read_text()}'
            assert time.monotonic() < end, f'{block}: timed out\n{log.read_text()}'
            time.sleep(0.05)  # polling a file that another process writes

    def stop(self, block, process, log):
        """Stop with Ctrl-C; the process has its own group."""
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
        try:
            process.wait(TIMEOUT)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            pytest.fail(f'{block}: does not end on Ctrl-C\n{log.read_text()}')
        with suppress(ProcessLookupError):  # what the shell has left
            os.killpg(process.pid, signal.SIGKILL)
        assert 'Traceback' not in log.read_text(), f'{block}:\n{log.read_text()}'


@pytest.mark.parametrize('page', PAGES, ids=by_name)
def test_the_commands_of_a_page_work(page, tmp_path):
    with ExitStack() as stack:
        sandbox = Sandbox(tmp_path, stack)
        for block in blocks(page):
            sandbox.apply(block)


@pytest.mark.parametrize('block', [b for b in BLOCKS if b.language == 'bash'], ids=str)
def test_the_programs_and_options_of_a_command_exist(block):
    if block.mark == 'fails':
        return
    for words in docs_commands.commands(block.text):
        assert docs_commands.error_in(words) == '', ' '.join(words)


@pytest.mark.parametrize('block', [b for b in BLOCKS if b.language == 'python'], ids=str)
def test_a_snippet_is_python(block):
    ast.parse(block.text)


@pytest.mark.parametrize('block', [b for b in BLOCKS if b.language in ('yaml', 'json')], ids=str)
def test_a_file_shown_in_a_page_can_be_read(block, tmp_path):
    read = yaml.safe_load(block.text) if block.language == 'yaml' else json.loads(block.text)
    if 'uavs' in read and not block.mark:
        (tmp_path / 'shown.yaml').write_text(block.text)
        scenario.load(tmp_path / 'shown.yaml')


@pytest.mark.parametrize('block', BLOCKS, ids=str)
def test_a_block_has_a_language(block):
    assert block.language in LANGUAGES, f'{block}: expected one of {LANGUAGES} after ```'


@pytest.mark.parametrize('page', PAGES, ids=by_name)
def test_no_command_is_outside_a_block(page):
    hidden = re.compile(r'( {4,}|\t)(make|python3?|pip|ros2|colcon|git|sudo|sim_vehicle\.py) ')
    assert [f'{number}: {line}' for number, line in prose(page) if hidden.match(line)] == []
    marks = re.compile(rf'<!-- (?!({"|".join(MARKS)}): )')
    assert [f'{number}: {line}' for number, line in prose(page) if marks.match(line)] == []


@pytest.mark.parametrize('page', PAGES, ids=by_name)
def test_links_have_a_target(page):
    for number, line in prose(page):
        for target in re.findall(r'\]\(([^)]+)\)', line):
            if not re.match(r'https?:|#', target):
                path = page.parent / target.partition('#')[0]
                assert path.exists(), f'{page.name}:{number}: {target}'


def texts_of_the_sources():
    """All string literals of the package; formatted values are replaced by NUL."""
    texts = []
    for path in sorted((ROOT / 'uav_task_alloc').rglob('*.py')):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.JoinedStr):
                texts.append('\0'.join(part.value for part in node.values
                                       if isinstance(part, ast.Constant)))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                texts.append(node.value)
    return '\n'.join(texts)


def quoted_errors():
    """The errors quoted in headings of the faq."""
    for line in (ROOT / 'docs/faq.md').read_text().splitlines():
        match = re.fullmatch(r'### `(.+)`', line)
        if match:
            yield match[1]


def test_every_error_quoted_in_the_faq_is_in_the_sources():
    ours, errors = texts_of_the_sources(), list(quoted_errors())
    assert len(errors) >= 15
    for error in errors:
        pieces = re.split(r'\.\.\.|: expected|expected |waits for | = ', error)
        assert any(len(piece) > 8 for piece in pieces), f'{error}: no text to search for'
        for piece in pieces:
            assert piece.strip() in ours, f'{error}: {piece!r} is in no source'


@pytest.mark.parametrize('word', [
    'piece', 'strip', 'separation', 'separation alert', 'fence', 'fence area', 'rally point',
    'relaunch', 'capability', 'acceptance radius', 'battery reserve', 'turn home'])
def test_a_word_of_messages_and_diagnostics_is_in_the_glossary(word):
    assert f'\n| {word} |' in (ROOT / 'docs/glossary.md').read_text()


def test_the_numbers_in_the_readme_are_those_of_the_demo():
    demo = scenario.load(ROOT / 'config/scenarios/demo.yaml')
    text = (ROOT / 'README.md').read_text()
    late = sum(timed.at > 0.0 for timed in demo.tasks)
    assert (len(demo.uavs), len(demo.zones)) == (4, 3)
    assert f'{len(demo.tasks)} tasks' in text
    assert f'{late} arrive in flight' in text


def test_a_wrong_mark_or_fence_is_detected(tmp_path, monkeypatch):
    page = tmp_path / 'page.md'
    page.write_text('<!-- until: ready -->\n```bash\nmake demo\n```\ntext\n```\nopen\n')
    with pytest.raises(AssertionError, match='expected a closing fence'):
        blocks(page)
    page.write_text('<!-- until: ready -->\n\n```bash\nmake demo\n```\n```text\nx\n```\n')
    first, second = blocks(page)
    assert (first.mark, first.what, first.text, second.mark) == ('until', 'ready', 'make demo\n',
                                                                 '')


@pytest.mark.parametrize('path', sorted(ROOT.glob('launch/*.py')), ids=lambda path: path.name)
def test_a_launch_file_starts_existing_programs(path):
    assert docs_commands.error_in(['ros2', 'launch', 'uav_task_alloc', path.name]) == ''
    assert launch_stand_in.commands(path, {})


@pytest.mark.parametrize(('line', 'error'), [
    ('make demmo', 'demmo'),
    ('python -m uav_task_alloc plan x.yaml --plott x.png', 'no option --plott'),
    ('python -m uav_task_alloc plann', 'plann'),
    ('uav_task_alloc plan x.yaml --bugdet 3', 'no option --bugdet'),
    ('uav_task_alloc compile --wirte', 'no option --wirte'),
    ('uav_task_alloc study scuots --runs 3', 'no option --runs'),
    ('pip install .[plott]', 'no extra plott'),
    ('ros2 run uav_task_alloc allocater', 'no such executable'),
    ('ros2 run uav_task_alloc allocator --ros-args -p buget:=1.0', 'no parameter buget'),
    ('ros2 launch uav_task_alloc fleet.launch.py names:=x', 'no argument names'),
    ('cd x && flyto moon', 'flyto'),
    ('python benchmarks/none.py', 'no such file'),
])
def test_a_wrong_command_is_detected(line, error):
    assert any(error in docs_commands.error_in(words) for words in docs_commands.commands(line))


@pytest.mark.parametrize('line', [
    'python -m uav_task_alloc plan x.yaml --plot x.png --budget 3', 'make demo',
    'X=1 ros2 run uav_task_alloc allocator --ros-args -p solve_budget:=0.2',
    "ros2 run uav_task_alloc mavlink_bridge --ros-args -p connections:=\"['tcp:127.0.0.1:5760']\"",
])
def test_a_correct_command_passes(line):
    assert all(docs_commands.error_in(words) == '' for words in docs_commands.commands(line))
