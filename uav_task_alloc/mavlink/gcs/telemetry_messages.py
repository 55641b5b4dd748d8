# SPDX-License-Identifier: Apache-2.0
"""Messages of a vehicle: their requested rates, and those that report a state."""
from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as d

# requested rate [Hz] by message id
RATES = {
    d.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 5.0, d.MAVLINK_MSG_ID_MISSION_CURRENT: 2.0,
    d.MAVLINK_MSG_ID_BATTERY_STATUS: 1.0, d.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
    d.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0, d.MAVLINK_MSG_ID_HOME_POSITION: 0.2,
    d.MAVLINK_MSG_ID_GPS_RAW_INT: 1.0,
}
# id of the estimator report by HEARTBEAT.autopilot
ESTIMATE = {d.MAV_AUTOPILOT_ARDUPILOTMEGA: d.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
            d.MAV_AUTOPILOT_PX4: d.MAVLINK_MSG_ID_ESTIMATOR_STATUS}
# types that report a state: an older frame is ignored; all others are events
STATE_REPORTS = frozenset({
    'HEARTBEAT', 'GLOBAL_POSITION_INT', 'HOME_POSITION', 'BATTERY_STATUS', 'SYS_STATUS',
    'EXTENDED_SYS_STATE', 'MISSION_CURRENT', 'GPS_RAW_INT', 'EKF_STATUS_REPORT',
    'ESTIMATOR_STATUS'})
# those that say nothing of the flight itself: it is early enough to act on them at the next step
HEALTH_REPORTS = frozenset({
    'BATTERY_STATUS', 'SYS_STATUS', 'GPS_RAW_INT', 'EKF_STATUS_REPORT', 'ESTIMATOR_STATUS'})
# ids of all that the bridge reads
WANTED = frozenset({*RATES, *ESTIMATE.values(), *(
    getattr(d, 'MAVLINK_MSG_ID_' + name) for name in (
    'HEARTBEAT', 'MISSION_REQUEST', 'MISSION_REQUEST_INT', 'MISSION_ACK', 'MISSION_COUNT',
    'MISSION_ITEM', 'MISSION_ITEM_INT', 'MISSION_ITEM_REACHED', 'COMMAND_ACK', 'STATUSTEXT',
    'SYSTEM_TIME', 'PARAM_VALUE', 'SMART_BATTERY_INFO'))})
