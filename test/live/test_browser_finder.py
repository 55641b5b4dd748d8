# SPDX-License-Identifier: Apache-2.0
"""tools/browser.sh with a PATH of only the programs that it needs."""
import shutil
import subprocess

import pytest
from chromium import FINDER


@pytest.fixture
def find(tmp_path):
    """find(CHROMIUM=..., ...) -> the finished process."""
    for name in ('bash', 'env', 'realpath', 'dirname'):
        (tmp_path / name).symlink_to(shutil.which(name))

    def find(**env):
        return subprocess.run([FINDER, '--find', tmp_path / 'ros'], text=True,
                              capture_output=True, env={'PATH': str(tmp_path), **env})
    return find


def program(path, status=0):
    path.parent.mkdir(exist_ok=True)
    path.write_text(f'#!{shutil.which("sh")}\nexit {status}\n')
    path.chmod(0o755)
    return str(path)


def test_a_browser_named_by_chromium_comes_first(find, tmp_path):
    program(tmp_path / 'chromium')
    named = program(tmp_path / 'mine')
    assert find(CHROMIUM=named).stdout == named + '\n'


def test_a_browser_that_does_not_start_is_skipped(find, tmp_path):
    program(tmp_path / 'chromium', status=1)
    found = program(tmp_path / 'google-chrome')
    assert find(CHROMIUM='no such').stdout == found + '\n'


def test_without_a_browser_it_fails_only_where_one_is_required(find):
    found, required = find(), find(REQUIRE_BROWSER='1')
    assert (found.stdout, found.returncode) == ('', 0)
    assert (required.stdout, required.returncode) == ('', 1)
