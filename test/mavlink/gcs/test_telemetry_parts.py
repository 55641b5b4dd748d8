# SPDX-License-Identifier: Apache-2.0
"""Which reports of a vehicle count: valid positions, the newest of a type, and MISSION_CURRENT."""
import pytest
from mission_bench import ORIGIN, OURS
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import PX4 as PX4_PROFILE
from uav_task_alloc.mavlink.gcs.mission_report import MissionReport
from uav_task_alloc.mavlink.gcs.newest_reports import NewestReports
from uav_task_alloc.mavlink.gcs.position_validity import PositionValidity
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.transport.codec import Codec

PX4, ARDUPILOT = d.MAV_AUTOPILOT_PX4, d.MAV_AUTOPILOT_ARDUPILOTMEGA
EKF, ESTIMATOR = d.MAVLINK_MSG_ID_EKF_STATUS_REPORT, d.MAVLINK_MSG_ID_ESTIMATOR_STATUS
GPS = d.MAVLINK_MSG_ID_GPS_RAW_INT


def ekf(flags):
    return d.MAVLink_ekf_status_report_message(flags, 0.1, 0.1, 0.1, 0.1, 0.0)


def gps(fix):
    return d.MAVLink_gps_raw_int_message(0, fix, 0, 0, 0, 0, 0, 0, 0, 0)


def test_a_position_without_other_reports_is_valid_after_3_s():
    validity = PositionValidity()
    assert not validity.is_valid(PX4, (), 10.0)
    assert not validity.is_valid(PX4, (), 12.9)
    assert validity.is_valid(PX4, (), 13.0)
    validity.forget()
    assert not validity.is_valid(PX4, (), 13.1)


@pytest.mark.parametrize(('flags', 'fix', 'ids', 'valid'), [
    (d.EKF_POS_HORIZ_ABS, d.GPS_FIX_TYPE_NO_FIX, {EKF, GPS}, True),  # the estimator decides
    (0, d.GPS_FIX_TYPE_3D_FIX, {EKF, GPS}, False),
    (0, d.GPS_FIX_TYPE_3D_FIX, {GPS}, True),
    (0, d.GPS_FIX_TYPE_2D_FIX, {GPS}, False),
    (d.EKF_POS_HORIZ_ABS, d.GPS_FIX_TYPE_NO_FIX, {ESTIMATOR, GPS}, False)])  # that of a PX4
def test_a_position_is_valid_by_the_estimator_else_by_the_gps(flags, fix, ids, valid):
    validity = PositionValidity()
    validity.take_estimate(ekf(flags), 1.0)
    validity.take_gps(gps(fix), 1.0)
    assert validity.is_valid(ARDUPILOT, ids, 1.0) is valid


def test_an_older_frame_of_a_state_is_outdated_for_5_s_and_an_event_never():
    newest, state = NewestReports(), d.MAVLink_mission_current_message(0)
    assert not newest.is_outdated(state, 100, 1.0)
    assert newest.is_outdated(state, 99, 1.1)
    assert not newest.is_outdated(d.MAVLink_mission_item_reached_message(0), 99, 1.1)
    assert not newest.is_outdated(state, 99, 6.1)  # the numbers may have begun again


def test_each_battery_is_a_type_of_its_own():
    def battery(number):
        return d.MAVLink_battery_status_message(number, 0, 0, 0, [0] * 10, 0, 0, 0, 50)

    newest = NewestReports()
    assert not newest.is_outdated(battery(0), 100, 1.0)
    assert not newest.is_outdated(battery(1), 99, 1.1)
    assert newest.is_outdated(battery(0), 98, 1.2)
    newest.forget()
    assert not newest.is_outdated(battery(0), 1, 1.3)


def current(state, mode=0, seq=1, total=0):
    return d.MAVLink_mission_current_message(seq, total, state, mode)


def report(atomic, *states, mode=0):
    mission = MissionReport(atomic)
    for n, state in enumerate(states, 1):
        mission.receive(current(state, mode), n, float(n))
    return mission


ACTIVE, COMPLETE = d.MISSION_STATE_ACTIVE, d.MISSION_STATE_COMPLETE
NOT_STARTED, UNKNOWN = d.MISSION_STATE_NOT_STARTED, d.MISSION_STATE_UNKNOWN


@pytest.mark.parametrize(('states', 'ended', 'restarted'), [
    ((ACTIVE, COMPLETE), True, False),
    ((UNKNOWN, COMPLETE), False, False),  # perhaps since long
    ((COMPLETE, COMPLETE), False, False),
    ((COMPLETE, ACTIVE), False, True)])
def test_an_ardupilot_reports_that_its_mission_has_ended_or_begun_again(states, ended, restarted):
    mission = report(False, *states)
    assert (mission.ended, mission.restarted) == (ended, restarted)
    mission = report(True, *states)  # PX4: by a take-off as well
    assert (mission.ended, mission.restarted) == (False, False)


@pytest.mark.parametrize(('states', 'mode', 'stopped'), [
    ((ACTIVE, NOT_STARTED), 1, False),  # it may be of the moment at which it began
    ((NOT_STARTED, NOT_STARTED), 1, True),
    ((NOT_STARTED, NOT_STARTED), 0, False)])
def test_an_ardupilot_in_mission_mode_reports_a_stopped_mission_twice(states, mode, stopped):
    assert report(False, *states, mode=mode).stopped is stopped


def test_only_an_ardupilot_shows_mission_mode_in_its_report():
    assert report(False, ACTIVE, ACTIVE, mode=1).in_mission_frame == 2
    assert report(True, ACTIVE, ACTIVE, mode=1).in_mission_frame == 0


@pytest.mark.parametrize(('total', 'known'), [(0, None), (7, 7), (65535, None)])
def test_the_number_of_items_is_known_where_it_is_reported(total, known):
    mission = MissionReport(atomic=False)
    mission.receive(current(ACTIVE, 1, seq=3, total=total), 5, 2.0)
    assert (mission.current, mission.current_at, mission.total) == (3, 2.0, known)
    mission.forget()
    assert mission.current is mission.total is None
    assert (mission.state, mission.plan_id, mission.in_mission_frame) == (UNKNOWN, 0, 0)


def test_a_vehicle_that_has_restarted_has_to_show_all_again():
    telemetry, sends, receives = Telemetry(PX4_PROFILE, ORIGIN, 0.0), Codec(1, 1), Codec(*OURS)

    def receive(now):
        frames = (sends.pack(d.MAVLink_global_position_int_message(
            round(now * 1e3), 473977420, 85455940, 488000, 0, 0, 0, 0, 0)),
            sends.pack(current(ACTIVE, seq=3)))
        for message in receives.parse(b''.join(frames)):
            telemetry.receive(message, now)

    for now in (1.0, 2.0, 3.0, 4.0):
        receive(now)
    assert (telemetry.has_position, telemetry.mission.current) == (True, 3)
    telemetry.restart()
    assert (telemetry.has_position, telemetry.mission.current) == (False, None)
    receive(4.5)
    assert (telemetry.has_position, telemetry.mission.current) == (False, 3)
