# SPDX-License-Identifier: Apache-2.0
"""The class of each flight mode by number, and the table of authority in the docs."""
from pathlib import Path

import pytest
from pymavlink import mavutil

from uav_task_alloc.mavlink.autopilots import (
    ARDUPILOT,
    ARDUPLANE,
    GENERIC,
    PX4,
    PX4_PLANE,
    ModeFunction,
)
from uav_task_alloc.mavlink.gcs.authority import table_text
from uav_task_alloc.mavlink.gcs.flight_modes import (
    ModeClass,
    avoids_traffic,
    mode_class,
    mode_name,
)
from uav_task_alloc.sim.modes import COPTER_MODES, PX4_MODES, px4_mode

M, HOLD, STICK, OWN = ModeClass.MISSION, ModeClass.HOLD, ModeClass.STICK, ModeClass.OWN
COPTER_STICK = {0, 1, 2, 5, 11, 13, 14, 15, 16, 18, 22, 24, 25, 26, 28, 29}
PLANE_STICK = {0, 2, 3, 4, 5, 6, 7, 8, 17, 18, 19, 23}
DOCS = Path(__file__).parents[3] / 'docs' / 'mavlink.md'


def test_each_copter_mode_has_the_class_of_the_table():
    for number in range(256):
        expected = {3: M, 4: HOLD}.get(number, STICK if number in COPTER_STICK else OWN)
        assert mode_class('copter', number) is expected, number


def test_each_plane_mode_has_the_class_of_the_table():
    for number in range(256):
        expected = {10: M, 15: HOLD}.get(number, STICK if number in PLANE_STICK else OWN)
        assert mode_class('plane', number) is expected, number


@pytest.mark.parametrize('main', range(12))
def test_each_px4_mode_has_the_class_of_the_table(main):
    for sub in range(16):
        expected = STICK if main in (1, 2, 3, 5, 7, 8) else OWN
        if main == 4:
            expected = {4: M, 3: HOLD}.get(sub, OWN)
        assert mode_class('px4', px4_mode(main, sub)) is expected


def test_an_autopilot_of_unknown_kind_has_no_mode_classes():
    for number in (0, 3, 4, px4_mode(4, 4), 0xffffffff):
        assert mode_class('', number) is None
        assert mode_class('rover', number) is None
        assert mode_name('', number) == f'mode {number}'
    assert GENERIC.family == ''


def test_modes_are_named_as_the_autopilots_name_them():
    def plain(name):
        return name.replace(' ', '').replace('_', '')
    for number, mode in COPTER_MODES.items():
        assert plain(mode_name('copter', number)) == plain(mode.name)
    for number, name in mavutil.mode_mapping_apm.items():
        shown = mode_name('plane', number)
        assert number == 16 or plain(shown) == plain(name)  # 16: INITIALISING
    for number in PX4_MODES:
        assert not mode_name('px4', number).startswith('mode ')
    assert mode_name('copter', 99) == 'mode 99'
    assert mode_name('px4', px4_mode(9)) == f'mode {px4_mode(9)}'


def test_the_stick_modes_of_the_simulated_vehicles_are_those_of_the_table():
    for family, modes in (('copter', COPTER_MODES), ('px4', PX4_MODES)):
        for number, mode in modes.items():
            assert mode.stick is (mode_class(family, number) is STICK), (family, number)


def test_only_avoid_adsb_avoids_traffic():
    avoiding = [(family, number) for family in ('copter', 'plane', 'px4', '')
             for number in range(256) if avoids_traffic(family, number)]
    assert avoiding == [('copter', 19), ('plane', 14)]


@pytest.mark.parametrize('profile', [ARDUPILOT, ARDUPLANE, PX4, PX4_PLANE])
def test_each_mode_that_the_bridge_commands_has_the_class_of_its_function(profile):
    assert mode_class(profile.family, profile.set_mode[ModeFunction.MISSION]) is M
    assert mode_class(profile.family, profile.set_mode[ModeFunction.HOLD]) is HOLD
    assert mode_class(profile.family, profile.set_mode[ModeFunction.RETURN]) is OWN
    for number, flight in profile.modes.items():
        assert (mode_class(profile.family, number) is M) is (flight is ModeFunction.MISSION)


def test_the_docs_contain_the_generated_table():
    section = DOCS.read_text('utf-8').split('## Authority\n')[1].split('\n## ')[0]
    rows = [line for line in section.splitlines() if line.startswith('|')]
    expected = [line for line in table_text().splitlines() if line]
    assert rows == expected, 'paste authority.table_text() into docs/mavlink.md'
