# SPDX-License-Identifier: Apache-2.0
"""The command `params`: the generated reference pages, and the parameter files of the nodes."""
from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from uav_task_alloc import parameter_texts, params
from uav_task_alloc.allocator.state import task_state_machine
from uav_task_alloc.cli.options import OptionParser
from uav_task_alloc.cli.outputs import naming
from uav_task_alloc.scenario import document


def main(argv: Sequence[str]) -> int:
    """Print the pages, or with `--write` write them and config/*.yaml into the working directory.

    Raises:
        InvalidValue: a file cannot be written.
        SystemExit: the arguments are malformed, or ask for the help.
    """
    parser = OptionParser(
        'params', 'Print the tables of all node parameters, scenario keys and task states, each '
        'with its default, range and unit (docs/parameters.md, scenarios.md and task_states.md).')
    parser.add_argument('--write', action='store_true', help='write them into docs/, and the '
                        'parameter files of the nodes into config/, both in the working '
                        'directory (default: print)')
    pages = {Path('docs/parameters.md'): parameter_texts.markdown_text(),
             Path('docs/scenarios.md'): document.scenario_page(),
             Path('docs/task_states.md'): task_state_machine.task_states_markdown()}
    if not parser.parsed(argv).write:
        print('\n'.join(pages.values()))
        return 0
    configs = {Path(f'config/{node}.yaml'): parameter_texts.yaml_text(node)
               for node in params.NODES}
    for path, text in {**pages, **configs}.items():
        with naming('--write', path):
            path.parent.mkdir(exist_ok=True)
            path.write_text(text)
    return 0
