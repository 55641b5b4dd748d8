# SPDX-License-Identifier: Apache-2.0
"""Parsing of public instances: Chao's team orienteering, MSTOP, Cordeau's MDVRP."""
import math

import pytest

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.study import public

CHAO = """n 5
m 2
tmax 7.5
0.0\t0.0\t0
1.0\t2.0\t10
3.0\t1.0\t0
4.0\t4.0\t25
5.0\t5.0\t0
"""
MSTOP = """n 5
m 3
tmax 9.0
0.0\t0.0\t0\t1\t2
9.0\t0.0\t0\t1\t1
1.0\t2.0\t10\t0\t0
4.0\t4.0\t25\t0\t0
5.0\t5.0\t0\t0\t0
"""
# type, vehicles a depot, customers, depots; longest duration and load; i x y service demand ...
CORDEAU = """2 2 3 2
60 0
80 0
1 10 0 0 5 1 2 1 2
2 20 0 0 5 1 2 1 2
3 30 0 0 5 1 2 1 2
4 0 0 0 0 0 0
5 40 0 0 0 0 0
"""


def test_team_orienteering_starts_at_the_first_point_and_ends_at_the_last():
    instance = public.parse_instance('p1.txt', CHAO, known=35.0)
    assert [(u.position, u.home, u.range) for u in instance.uavs] == [
        ((0.0, 0.0, 0.0), (5.0, 5.0, 0.0), 7.5)] * 2
    assert [(t.id, t.position, t.value) for t in instance.tasks] == [
        ('t1', (1.0, 2.0, 0.0), 10.0), ('t3', (4.0, 4.0, 0.0), 25.0)]  # no score, no task
    assert (instance.route_end, instance.collects, instance.known) == ('home', True, 35.0)


def test_multi_source_orienteering_has_the_given_number_of_uavs_at_each_start():
    instance = public.parse_instance('g1.txt', MSTOP)
    assert [u.position for u in instance.uavs] == [(0.0, 0.0, 0.0)] * 2 + [(9.0, 0.0, 0.0)]
    assert {u.home for u in instance.uavs} == {(5.0, 5.0, 0.0)}
    assert [t.id for t in instance.tasks] == ['t2', 't3']


def test_columns_that_are_flags_only_mark_starts_and_the_end():
    flagged = MSTOP.replace('\t1\t2\n', '\t1\t0\n').replace('\t1\t1\n', '\t1\t0\n').replace(
        '1.0\t2.0\t10\t0\t0', '1.0\t2.0\t0\t0\t1')
    instance = public.parse_instance('g1.txt', flagged)
    assert [u.position[0] for u in instance.uavs] == [0.0, 9.0, 0.0]  # in turn
    assert {u.home for u in instance.uavs} == {(1.0, 2.0, 0.0)}


def test_a_multi_depot_problem_has_its_uavs_at_the_depots_with_durations_as_ranges():
    instance = public.parse_instance('p01', CORDEAU, known=77.0)
    assert [(u.position[0], u.range) for u in instance.uavs] == [
        *[(0.0, 60.0)] * 2, *[(40.0, 80.0)] * 2]
    assert [t.position[0] for t in instance.tasks] == [10.0, 20.0, 30.0]
    assert (instance.route_end, instance.collects, instance.known) == ('home', False, 77.0)


def test_a_published_length_is_ignored_where_loads_are_limiting():
    assert math.isnan(
        public.parse_instance('p01', CORDEAU.replace('60 0', '60 10'), known=77.0).known
    )


@pytest.mark.parametrize(('text', 'reason'), [
    ('', 'an instance of Chao, MSTOP, Cordeau, VRPLIB or TOPTW'),
    ('# a note\n', 'an instance of Chao, MSTOP, Cordeau, VRPLIB or TOPTW'),
    (CHAO.replace('n 5', 'n 6'), 'n = 6, at least 2'),
    (CORDEAU.replace('10 0 0 5', '10 0 3 5'), 'ranges hold no service time'),
    (CORDEAU.replace('2 2 3 2', '4 2 3 2'), 'expected type 2'),
    (MSTOP.replace('10\t0\t0', '10\t0\t1').replace('25\t0\t0', '25\t0\t1'), 'a start, one end'),
])
def test_an_unsupported_instance_is_refused(text, reason):
    with pytest.raises(InvalidValue, match=reason):
        public.parse_instance('file', text)


def test_a_folder_is_read_by_name_and_reports_skipped_files(tmp_path):
    (tmp_path / 'a.txt').write_text(CHAO)
    (tmp_path / 'b.txt').write_text(MSTOP)
    (tmp_path / 'c.txt').write_bytes(b'\xff\xfe')
    (tmp_path / 'README.md').write_text('words')
    (tmp_path / public.BEST_KNOWN_FILE).write_text('# best\na.txt 35\n')
    texts, skipped = public.read_folder(tmp_path, '*.txt')
    assert (list(texts), list(skipped)) == (['a.txt', 'b.txt'], ['c.txt'])
    assert public.best_known(tmp_path) == {'a.txt': 35.0}
