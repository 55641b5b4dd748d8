# SPDX-License-Identifier: Apache-2.0
"""Variables of SROS 2 that are incomplete: a node says that it is not secured, or ends."""
import pytest

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.nodes.ros.security import enclave_of, security_warning

pytestmark = pytest.mark.ros
ENABLE, KEYSTORE, STRATEGY = (
    'ROS_SECURITY_ENABLE', 'ROS_SECURITY_KEYSTORE', 'ROS_SECURITY_STRATEGY')
ON, ENFORCE = {ENABLE: 'true'}, {ENABLE: 'true', STRATEGY: 'Enforce'}


@pytest.fixture
def keystore(tmp_path):
    (tmp_path / 'enclaves/uav_task_alloc/allocator').mkdir(parents=True)
    return {KEYSTORE: str(tmp_path)}


@pytest.mark.parametrize('environment', [{}, {ENABLE: ''}, {ENABLE: 'false', STRATEGY: 'Enforce'}])
def test_without_security_nothing_is_said(environment):
    assert security_warning(environment, '/') == ''


def test_with_keys_nothing_is_said(keystore):
    for variables in (ON, ENFORCE, {**ON, STRATEGY: 'Permissive'}):
        assert security_warning({**variables, **keystore}, '/uav_task_alloc/allocator') == ''
    override = {'ROS_SECURITY_ENCLAVE_OVERRIDE': '/uav_task_alloc/allocator'}
    assert security_warning({**ENFORCE, **keystore, **override}, '/') == ''


def test_what_is_not_secured_says_so(keystore):
    end = ': this node runs without security, as ROS_SECURITY_STRATEGY is not Enforce'
    assert security_warning(ON, '/') == (
        "ROS_SECURITY_KEYSTORE = '': expected the folder of a keystore, as ROS_SECURITY_ENABLE is "
        'true' + end)
    assert security_warning({**ON, **keystore}, '/x') == (
        f"ROS_SECURITY_KEYSTORE = '{keystore[KEYSTORE]}': expected the keys of this node in "
        f'{keystore[KEYSTORE]}/enclaves/x (the enclave is given by --ros-args --enclave){end}')
    assert security_warning({ENABLE: 'True'}, '/') == (
        "ROS_SECURITY_ENABLE = 'True': expected true or false: this node runs without security")
    assert security_warning({**ON, **keystore, STRATEGY: 'enforce'}, '/uav_task_alloc/allocator'
                            ).startswith("ROS_SECURITY_STRATEGY = 'enforce': expected Enforce or ")


def test_what_must_be_secured_does_not_start(keystore):
    for variables in (ENFORCE, {**ENFORCE, **keystore}):
        with pytest.raises(InvalidValue, match=r'^ROS_SECURITY_KEYSTORE = .*: expected the '):
            security_warning(variables, '/x')


def test_the_enclave_is_that_of_the_command_line():
    assert enclave_of(['allocator']) == '/'
    assert enclave_of(['allocator', '--ros-args', '--enclave', '/a', '-e', '/b']) == '/b'


def test_a_node_that_must_be_secured_names_what_is_missing(execute):
    node = execute('mavlink_bridge', env=ENFORCE)
    assert node.popen.wait(60.0) == 1
    assert node.output() == ("ROS_SECURITY_KEYSTORE = '': expected the folder of a keystore, as "
                             'ROS_SECURITY_ENABLE is true\n')


def test_a_node_that_is_not_secured_logs_a_warning(execute, probe):
    node = execute('mavlink_bridge', '-p', "connections:=['udpin:127.0.0.1:0']", env=ON)
    probe.until(lambda: 'this node runs without security, as ' in node.output())
    assert node.stop()[0] == 0
