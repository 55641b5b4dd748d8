# SPDX-License-Identifier: Apache-2.0
"""The command of the demo up to the start of its nodes; `make demo` flies it."""
import pytest

from uav_task_alloc.nodes import demo

pytestmark = pytest.mark.ros


class Started(Exception):
    """All that the demo checks is good."""


@pytest.fixture(autouse=True)
def no_nodes(monkeypatch):
    def start(*_):
        raise Started
    monkeypatch.setattr(demo, 'start_nodes', start)


def test_finding_34_a_folder_with_files_of_others_is_refused_and_left_as_it_is(tmp_path, capsys):
    thesis = tmp_path / 'results' / 'thesis.tex'
    thesis.parent.mkdir()
    thesis.write_text('years of work')
    assert demo.main(['--out', str(thesis.parent)]) == 1
    assert 'thesis.tex' in capsys.readouterr().err
    assert thesis.read_text() == 'years of work'


def test_finding_34_a_bad_scenario_costs_no_earlier_results(tmp_path, capsys):
    with pytest.raises(Started):
        demo.main(['--out', str(tmp_path / 'out')])
    summary = tmp_path / 'out' / 'summary.json'
    summary.write_text('{}')
    assert demo.main(['--out', str(tmp_path / 'out'), '--scenario', str(tmp_path / 'no')]) == 1
    assert 'expected a scenario file' in capsys.readouterr().err
    assert summary.exists()


def test_finding_34_the_results_of_the_last_demo_are_removed(tmp_path):
    out = tmp_path / 'out'
    for _ in range(2):
        with pytest.raises(Started):
            demo.main(['--out', str(out)])
        assert not (out / 'summary.json').exists()
        (out / 'summary.json').write_text('{}')
