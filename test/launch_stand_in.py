# SPDX-License-Identifier: Apache-2.0
"""`launch` and `launch_ros` where they are not installed: what this package's files use of them.

`commands(path, given)` is what a launch file would start. Anything else a file asks for is an
ImportError or a TypeError.
"""
import sys
import types
from pathlib import Path

SHARE = {'uav_task_alloc': str(Path(__file__).resolve().parent.parent)}


def text(value, given):
    """A value once the arguments are known."""
    if isinstance(value, Value):
        return value.text(given)
    if isinstance(value, (list, tuple)):
        return ''.join(text(part, given) for part in value)
    return str(value)


class Value:
    """A substitution of one thing."""

    def __init__(self, what):
        self.what = what


class Configuration(Value):
    def text(self, given):
        return given[self.what]


class Share(Value):
    def text(self, given):
        return SHARE[self.what]


class Joined(Value):
    def text(self, given):
        return '/'.join(text(part, given) for part in self.what)


class Equal(Value):
    """Whether two values are the same, as `true` or `false`."""

    same = True

    def __init__(self, what, other):
        super().__init__(what)
        self.other = other

    def text(self, given):
        return str((text(self.what, given) == text(self.other, given)) is self.same).lower()


class NotEqual(Equal):
    same = False


class Source(Value):
    def text(self, given):
        return text(self.what, given)


class Typed(Value):
    def __init__(self, what, value_type):
        super().__init__(what)
        self.type = value_type

    def text(self, given):
        value = self.type(text(self.what, given))
        return f"'{value}'" if self.type is str else str(value)  # as YAML, where '' is no value


class Condition(Value):
    wanted = ('true', '1')

    def text(self, given):
        return text(self.what, given).lower()

    def holds(self, given):
        return self.text(given) in self.wanted


class NotCondition(Condition):
    wanted = ('false', '0')


class Declared:
    def __init__(self, name, *, default_value, description=''):
        self.name, self.default = name, default_value

    def starts(self, given):
        given.setdefault(self.name, text(self.default, given))
        return []


class Include:
    def __init__(self, source, *, launch_arguments=(), condition=None):
        self.source, self.arguments, self.condition = source, launch_arguments, condition

    def starts(self, given):
        if self.condition and not self.condition.holds(given):
            return []
        inner = {key: text(value, given) for key, value in self.arguments}
        return commands(Path(text(self.source, given)), inner)


class Node:
    def __init__(self, *, package, executable, namespace='', name='', parameters=(), arguments=(),
                 remappings=(), output='', condition=None, respawn=False):
        self.package, self.executable, self.condition = package, executable, condition
        self.namespace, self.name, self.remappings = namespace, name, remappings
        self.parameters, self.arguments = parameters, arguments
        self.respawn = respawn

    def starts(self, given):
        if self.condition and not self.condition.holds(given):
            return []
        words = [self.package, self.executable, *(text(word, given) for word in self.arguments)]
        namespace = text(self.namespace, given).strip('/')
        renamed = [*self.remappings, *[('__ns', f'/{namespace}')] * bool(namespace),
                   *[('__node', self.name)] * bool(self.name)]
        words += ['--ros-args']
        words += [word for old, new in renamed for word in ('-r', f'{old}:={new}')]
        for each in self.parameters:
            if isinstance(each, dict):
                words += [word for key, value in each.items()
                          for word in ('-p', f'{key}:={text(value, given)}')]
            else:
                words += ['--params-file', text(each, given)]
        return [Words(words, self.respawn)]


class Words(list):
    """Of a command; `respawn`: it is started again whenever it ends."""

    def __init__(self, words, respawn):
        super().__init__(words)
        self.respawn = respawn


MODULES = {
    'launch': {'LaunchDescription': list},
    'launch.actions': {'DeclareLaunchArgument': Declared, 'IncludeLaunchDescription': Include},
    'launch.conditions': {'IfCondition': Condition, 'UnlessCondition': NotCondition},
    'launch.launch_description_sources': {'PythonLaunchDescriptionSource': Source},
    'launch.substitutions': {'LaunchConfiguration': Configuration, 'PathJoinSubstitution': Joined,
                             'EqualsSubstitution': Equal, 'NotEqualsSubstitution': NotEqual},
    'launch_ros': {}, 'launch_ros.actions': {'Node': Node},
    'launch_ros.parameter_descriptions': {'ParameterValue': Typed},
    'launch_ros.substitutions': {'FindPackageShare': Share},
}


def commands(path, given):
    """Words of `PACKAGE EXECUTABLE ...` for each node; KeyError for an unknown argument."""
    before = {name: sys.modules.get(name) for name in MODULES}
    for name, members in MODULES.items():
        sys.modules[name] = types.ModuleType(name)
        sys.modules[name].__dict__.update(members)
    try:
        scope = {}
        exec(compile(path.read_text(), str(path), 'exec'), scope)
        parts = scope['generate_launch_description']()
    finally:
        for name, module in before.items():
            if module is None:
                del sys.modules[name]
            else:
                sys.modules[name] = module
    declared = {part.name for part in parts if isinstance(part, Declared)}
    if set(given) - declared:
        raise KeyError(f'{path.name}: no argument {min(set(given) - declared)}')
    given = dict(given)
    return [words for part in parts for words in part.starts(given)]
