# SPDX-License-Identifier: Apache-2.0
"""Takes the pictures of docs/live_view.md: `python test/live/take_screenshots.py out/demo`."""
import argparse
import io
import json
from pathlib import Path

import chromium
from PIL import Image

from uav_task_alloc.live.__main__ import play
from uav_task_alloc.live.server import Server

FOLDER = Path(__file__).parents[2] / 'docs/live_view'


def moment(news):
    """(seconds, plan) of the plan that gave most tasks from one UAV to another."""
    plan = max(news['plans'], key=lambda plan: sum(
        bool(before) for row in plan['changes'] for _, before in row['added']))
    clock = news['clock']
    return (plan['wall'] - clock['start']) * clock['speedup'], plan


def save(name, png):
    """With a palette: a third of the size, and nobody sees it."""
    Image.open(io.BytesIO(png)).convert('RGB').quantize(256).save(
        FOLDER / f'{name}.png', optimize=True)


def ask(page, task):
    """Look for a task; wait until the page has answered and marked it on the map."""
    page.fill('#find', task)
    chromium.wait(page, '#answer', task)
    chromium.wait(page, '#map', 'looked for')  # the map is drawn after the words


def take(page, plan, left):
    """All pictures of one page."""
    given = [task for row in plan['changes'] for task, _ in row['added']]
    ask(page, given[-1])
    save('overview', page.screenshot())
    save('next', page.locator('#find-box').screenshot())
    save('replan', page.locator('#replan-box').screenshot())
    ask(page, left)
    save('why', page.locator('#find-box').screenshot())
    save('left', page.locator('#left-box').screenshot())
    page.locator('#scrub').evaluate("""node => {
        node.value = Number(node.min) + 0.5 * (node.max - node.min);
        node.dispatchEvent(new Event('input')); }""")
    chromium.wait(page, '#moment', 'ago')
    save('past', page.locator('footer').screenshot())
    page.set_viewport_size({'width': 390, 'height': 844})
    chromium.open_page(page, page.url)
    ask(page, left)
    save('phone', page.screenshot())


def main():
    """From a recorded run, a moment after its most interesting plan."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('out_dir', type=Path, help='a folder with record.jsonl of a demo')
    args = parser.parse_args()
    at, plan = moment(json.loads(play(args.out_dir).news(0)[1]))
    board = play(args.out_dir, at + 2.0)
    statuses = json.loads(board.news(0)[1])['parts']['statuses']
    left = next(task for task, (state, *_) in statuses.items() if state == 'UNASSIGNED')
    server = Server(board, '127.0.0.1', 0)
    server.start()
    FOLDER.mkdir(exist_ok=True)
    with chromium.started(chromium.find()) as browser:
        page = browser.new_page(viewport={'width': 1600, 'height': 930}, color_scheme='dark')
        chromium.open_page(page, server.address)
        take(page, plan, left)
    server.stop()


if __name__ == '__main__':
    main()
