# SPDX-License-Identifier: Apache-2.0
"""Hypothesis strategies of hostile messages, meant to make the allocator fail."""
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Point
from hypothesis import strategies as st
from std_msgs.msg import Header
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SetAvailability, SubmitTasks

NASTY = ('', ' ', '%s%n', '{}', '{0.__class__}', '../../etc/passwd', 'a\nb', '\x07\x1b[2J', 'a__b',
         '/', '9lives', '\ufffd', 'x' * 300, "'; DROP TABLE world; --", '~', 'null', 'task id')
NAMES = tuple(f'n{k}' for k in range(12))  # few, so that messages refer to the same ids
HUGE = (float('nan'), float('inf'), -float('inf'), 1e308, -1e308, 1e-308, -1.0, -0.0, 0.0, 1e12)
HUGE_32 = (*HUGE[:3], 3e38, -3e38, 1e-38, *HUGE[6:])

word = st.sampled_from(NAMES) | st.sampled_from(NASTY) | st.text(max_size=8)
wide = st.sampled_from(HUGE) | st.floats()
narrow = st.sampled_from(HUGE_32) | st.floats(width=32)
small = st.floats(-2000.0, 2000.0)
byte = st.integers(0, 3) | st.integers(0, 255)
seconds = st.sampled_from((0, 1, -1, 2**31 - 1, -2**31)) | st.integers(-2**31, 2**31 - 1)
count = st.integers(0, 2**32 - 1)
span = st.builds(Duration, sec=seconds, nanosec=count)
header = st.builds(Header, stamp=st.builds(Time, sec=seconds, nanosec=count), frame_id=word)


def points(number):
    return st.builds(Point, x=number, y=number, z=number)


def some(words, most=3):
    return st.lists(words, max_size=most)


point = points(small) | points(wide)
task = st.builds(
    m.Task, task_id=word, frame=byte, position=point, latitude=small | wide,
    longitude=small | wide, altitude=small | wide, value=st.just(1.0) | wide,
    service_time=st.just(Duration(sec=1)) | span, acceptance_radius=narrow,
    required_capabilities=some(word), allowed_uavs=some(word))
plain_task = st.builds(  # valid but for at most one field
    m.Task, task_id=st.sampled_from(NAMES), position=points(small), value=st.just(1.0) | wide)
zone = st.builds(
    m.ThreatZone, zone_id=word, shape=byte, center=point, radius=small | narrow,
    z_min=small | narrow, z_max=small | narrow, margin=st.just(0.0) | narrow,
    vertices=some(point, 6))
announcement = st.builds(m.TaskAnnouncement, header=header, action=byte,
                         tasks=some(task | plain_task))
state = st.builds(
    m.UavState, header=header, uav_id=word, position=point, home=point, battery=narrow,
    range_remaining=narrow, cruise_speed=narrow, capabilities=some(word), available=st.booleans(),
    mode=byte, mission_state=byte, authority=byte, active_task_id=word,
    list_revision=st.integers(0, 3) | count)
event = st.builds(m.TaskEvent, header=header, task_id=word, uav_id=word,
                  revision=st.integers(0, 3) | count, event=byte, reason=word)
zone_array = st.builds(m.ThreatZoneArray, header=header, zones=some(zone))
message = st.one_of(
    announcement, state, event, zone_array,
    st.builds(SubmitTasks.Request, announcement=announcement),
    st.builds(SetAvailability.Request, uav_id=word, available=st.booleans()))

# one field of a good message spoiled: (what, field, bad value)
not_a_name = st.sampled_from([name for name in NASTY if name != 'null'])
not_finite = st.sampled_from(HUGE[:3])
beyond = points(st.sampled_from(HUGE[:5]))
many = st.just([f'w{k}' for k in range(101)])
spoiled = st.one_of(
    st.tuples(st.just('task'), st.just('task_id'), not_a_name),
    st.tuples(st.just('task'), st.just('frame'), st.integers(2, 255)),
    st.tuples(st.just('task'), st.just('position'), beyond),
    st.tuples(st.just('task'), st.just('value'), st.sampled_from((*HUGE[:5], -1.0, 0.0, 1e13))),
    st.tuples(st.just('task'), st.just('service_time'), st.builds(
        Duration, sec=st.integers(-2**31, -5) | st.integers(10**9 + 5, 2**31 - 1),
        nanosec=count)),
    st.tuples(st.just('task'), st.just('acceptance_radius'),
              st.sampled_from((float('inf'), -float('inf'), -1.0, 3e38))),
    st.tuples(st.just('task'), st.just('required_capabilities'),
              st.lists(st.sampled_from(('', ' ', 'a\nb', '\x1b[2J', 'x' * 201)), min_size=1)
              | many),
    st.tuples(st.just('task'), st.just('allowed_uavs'), st.lists(not_a_name, min_size=1) | many),
    st.tuples(st.just('state'), st.just('uav_id'), not_a_name),
    st.tuples(st.just('state'), st.just('position'), beyond),
    st.tuples(st.just('state'), st.just('battery'), st.sampled_from((-0.5, 1.5, 3e38))),
    st.tuples(st.just('state'), st.just('range_remaining'), st.floats(max_value=-0.5,
                                                                    width=32)),
    st.tuples(st.just('state'), st.just('cruise_speed'), st.sampled_from((-1.0, 3e38, 1e5))),
    st.tuples(st.just('state'), st.just('mode'), st.integers(8, 255)),
    st.tuples(st.just('state'), st.just('mission_state'), st.integers(5, 255)),
    st.tuples(st.just('state'), st.just('authority'), st.integers(5, 255)),
    st.tuples(st.just('state'), st.just('active_task_id'), not_a_name.filter(bool)),
    st.tuples(st.just('state'), st.just('list_revision'), st.integers(2**31 + 1, 2**32 - 1)),
    st.tuples(st.just('state'), st.just('capabilities'), st.just(['']) | many),
    st.tuples(st.just('event'), st.just('task_id'), not_a_name),
    st.tuples(st.just('event'), st.just('uav_id'), not_a_name),
    st.tuples(st.just('event'), st.just('event'), st.integers(3, 255)),
    st.tuples(st.just('zone'), st.just('zone_id'), not_a_name),
    st.tuples(st.just('zone'), st.just('shape'), st.integers(3, 255)),
    st.tuples(st.just('zone'), st.just('center'), beyond),
    st.tuples(st.just('zone'), st.just('radius'),
              st.sampled_from((*HUGE_32[:5], -1.0, 0.0))),
    st.tuples(st.just('zone'), st.just('margin'), st.sampled_from((-1.0, 3e38))),
    st.tuples(st.just('zone'), st.just('vertices'), st.just([Point(x=float(k * k), y=float(k))
                                                             for k in range(201)])))
