# SPDX-License-Identifier: Apache-2.0
"""Builds the Python package, and under colcon the messages of msg_defs/ with it."""
import os
import shlex
import subprocess
import sys
from glob import glob
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.develop import develop
from setuptools.command.install import install

NAME = 'uav_task_alloc'
MESSAGES = NAME + '_msgs'
PROGRAMS = ('allocator', 'mavlink_bridge', 'fleet_sim', 'scenario_player', 'live_view', 'demo')


def add_messages(command):
    """Build msg_defs/ too, unless it is being built as a package of its own.

    colcon does not look for packages inside a package, so that a plain `colcon build` would
    leave the messages out.
    """
    if not hasattr(sys, 'real_prefix'):     # not colcon's build
        return
    env, prefix = dict(os.environ), sys.prefix
    found = [p for p in env.get('AMENT_PREFIX_PATH', '').split(':') if Path(
        p, 'share/ament_index/resource_index/packages', MESSAGES).exists()]
    if any(not os.path.exists(prefix) or not os.path.samefile(p, prefix) for p in found):
        return
    # colcon's stand-in for sys.prefix is not for the generators' Python
    env['PYTHONPATH'] = ':'.join(
        p for p in env.get('PYTHONPATH', '').split(':')
        if not p.endswith(('prefix_override', 'colcon_distutils_commands')))
    here = Path(__file__).resolve().parent
    build = Path(command.get_finalized_command('build').build_base, MESSAGES).resolve()
    for step in (
        ['cmake', '-S', str(here / 'msg_defs'), '-B', str(build), '-DBUILD_TESTING=OFF',
         f'-DCMAKE_INSTALL_PREFIX={prefix}'],
        ['cmake', '--build', str(build)],
        ['cmake', '--install', str(build)],
    ):
        subprocess.run(step, env=env, check=True)


def add_programs(command, folder):
    """Write the nodes' programs where `ros2 run` looks, and the command line onto PATH.

    A wheel has none of them, but the command line of `command_line`.
    """
    if any(command.distribution.get_command_obj(name, create=False)
           for name in ('bdist_wheel', 'editable_wheel')):
        return
    for name in PROGRAMS:
        write_program(Path(folder, name), 'program.in')
    write_program(Path(folder).parents[1] / 'bin' / NAME, 'command.in')


def command_line():
    """Return how pip installs the command line.

    A console script shows a traceback for a Ctrl-C before its first line of ours. So it is hidden,
    and a script for sh starts it; not on Windows.
    """
    by_sh = os.name == 'posix' and not hasattr(sys, 'real_prefix')  # not colcon's build
    name = f'.{NAME}' if by_sh else NAME
    return {'scripts': ['resource/pip/' + NAME] if by_sh else [],
            'entry_points': {'console_scripts': [f'{name} = {NAME}.cli.entry:main']}}


def write_program(path, template):
    """Write an executable from a template of resource/."""
    text = Path(__file__).resolve().parent.joinpath('resource', template).read_text()
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    path.write_text(text.replace('@PYTHON@', shlex.quote(sys.executable))
                    .replace('@NAME@', path.name))
    path.chmod(0o755)


class Install(install):
    """`install`, and the programs and messages after it."""

    def run(self):
        """Install this package, then the programs and the messages."""
        super().run()
        add_programs(self, self.install_scripts)
        add_messages(self)


class Develop(develop):
    """`develop` (colcon build --symlink-install), and the programs and messages after it."""

    def run(self):
        """Link this package, then install the programs and the messages."""
        super().run()
        add_programs(self, self.script_dir)
        add_messages(self)


setup(
    name=NAME,
    version='0.1.0',
    cmdclass={'install': Install, 'develop': Develop},
    packages=find_packages(include=[NAME, NAME + '.*']),
    package_data={NAME + '.live': ['page/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + NAME]),
        ('share/' + NAME, ['package.xml']),
        ('share/' + NAME + '/launch', glob('launch/*.launch.py')),
        ('share/' + NAME + '/config', glob('config/*.yaml') + glob('config/*.rviz')),
        ('share/' + NAME + '/config/sros2', glob('config/sros2/*.xml')),
        ('share/' + NAME + '/config/scenarios', glob('config/scenarios/*.yaml')),
    ],
    python_requires='>=3.10,<3.15',
    install_requires=['numpy', 'numba>=0.57', 'pymap3d', 'pymavlink', 'pyyaml', 'scipy'],
    extras_require={'plot': ['matplotlib'],
                    'study': ['distributed', 'ortools', 'pyvrp'],
                    'terrain': ['rasterio'],
                    'site': ['myst-parser', 'sphinx'],
                    'view': ['aiohttp', 'mcap', 'mcap-ros2-support', 'plotly'],
                    'test': ['hypothesis', 'matplotlib', 'mypy', 'pytest', 'pytest-xdist',
                             'ruff']},
    zip_safe=False,
    maintainer='uav_task_alloc developers',
    maintainer_email='uav_task_alloc@users.noreply.github.com',
    description='Allocates tasks to several UAVs as they arrive, around no-fly zones.',
    license='Apache-2.0',
    classifiers=['Programming Language :: Python :: 3', *(
        f'Programming Language :: Python :: 3.{minor}' for minor in range(10, 15))],
    **command_line(),
)
