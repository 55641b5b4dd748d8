# SPDX-License-Identifier: Apache-2.0
"""What RViz expects of a MarkerArray and of a Path."""
import math

from visualization_msgs.msg import Marker

LINES = (Marker.LINE_STRIP, Marker.LINE_LIST)
OF_POINTS = (*LINES, Marker.SPHERE_LIST, Marker.CUBE_LIST, Marker.TRIANGLE_LIST)


def check_markers(array):
    """Assert that a MarkerArray is valid; return the markers that are shown, by (ns, id)."""
    first, *rest = array.markers
    assert first.action == Marker.DELETEALL
    left = {(each.ns, each.id): each for each in rest}
    assert len(left) == len(rest), 'an id is there twice'
    for each in rest:
        assert each.action == Marker.ADD
        assert each.header == first.header
        check_marker(each)
    return left


def check_marker(each):
    """Assert that one marker can be drawn."""
    name = f'{each.ns} {each.id}'
    assert each.header.frame_id == 'map', name
    assert min(each.scale.x, each.scale.y, each.scale.z) > 0.0, name
    q = each.pose.orientation
    assert math.isclose(math.hypot(q.x, q.y, q.z, q.w), 1.0), name
    assert all(0.0 <= v <= 1.0 for v in (each.color.r, each.color.g, each.color.b)), name
    assert 0.0 < each.color.a <= 1.0, name
    assert all(math.isfinite(v) for p in [each.pose.position, *each.points]
               for v in (p.x, p.y, p.z)), name
    assert bool(each.text) == (each.type == Marker.TEXT_VIEW_FACING), name
    assert bool(each.points) == (each.type in (Marker.ARROW, *OF_POINTS)), name
    if each.type == Marker.ARROW:
        assert len(each.points) == 2, name
    if each.type in LINES:
        assert len(each.points) > 1, name
    if each.type == Marker.TRIANGLE_LIST:
        assert len(each.points) % 3 == 0, name


def check_path(path):
    """Assert that a Path is sound; its points."""
    for pose in path.poses:
        assert pose.header == path.header
        q = pose.pose.orientation
        assert math.isclose(math.hypot(q.x, q.y, q.z, q.w), 1.0)
    assert path.header.frame_id == 'map'
    return [(p.pose.position.x, p.pose.position.y, p.pose.position.z) for p in path.poses]


def texts(left, space):
    """The labels of a namespace."""
    return [each.text for (ns, _), each in left.items() if ns == space]


def points(left, space):
    """All points of a namespace."""
    return [(p.x, p.y, p.z) for (ns, _), each in left.items() if ns == space
            for p in each.points]
