# SPDX-License-Identifier: Apache-2.0
"""Take the screenshots of docs/live_view.md: `python test/live/take_screenshots.py out/demo`."""
import argparse
import io
import json
from pathlib import Path

import chromium
from PIL import Image

from uav_task_alloc.live.__main__ import play
from uav_task_alloc.live.server import PageServer

FOLDER = Path(__file__).parents[2] / 'docs/live_view'


def best_moment(out_dir):
    """(snapshots, plan, task left out) 2 s after the plan that reassigned most tasks of those
    after which a task was left out."""
    def reassigned(plan):
        return sum(bool(before) for row in plan['changes'] for _, before in row['added'])

    update = json.loads(play(out_dir).updates_since(0)[1])
    clock = update['clock']
    for plan in sorted(update['plans'], key=reassigned, reverse=True):
        snapshots = play(out_dir, (plan['wall'] - clock['start']) * clock['speedup'] + 2.0)
        statuses = json.loads(snapshots.updates_since(0)[1])['parts']['statuses']
        left = [task for task, (state, *_) in statuses.items() if state == 'UNASSIGNED']
        if left:
            return snapshots, plan, left[0]
    raise SystemExit(f'{out_dir}: expected a run in which a task was left out')


def save(name, png):
    """Save with a palette of 256 colours: a third of the size without visible loss."""
    Image.open(io.BytesIO(png)).convert('RGB').quantize(256).save(
        FOLDER / f'{name}.png', optimize=True)


def search(page, task):
    """Search for a task; wait until it is marked on the map."""
    page.fill('#find', task)
    chromium.wait(page, '#answer', task)
    page.wait_for_selector(f'#map[data-picked={task}]')  # the map is drawn after the text


def take(page, plan, left):
    """Take all screenshots of one page."""
    given = [task for row in plan['changes'] for task, _ in row['added']]
    search(page, given[-1])
    save('overview', page.screenshot())
    save('next', page.locator('#find-box').screenshot())
    save('replan', page.locator('#replan-box').screenshot())
    search(page, left)
    save('why', page.locator('#find-box').screenshot())
    save('left', page.locator('#left-box').screenshot())
    page.locator('#scrub').evaluate("""node => {
        node.value = Number(node.min) + 0.5 * (node.max - node.min);
        node.dispatchEvent(new Event('input')); }""")
    chromium.wait(page, '#moment', 'ago')
    save('past', page.locator('footer').screenshot())
    page.set_viewport_size({'width': 390, 'height': 844})
    chromium.open_page(page, page.url)
    save('phone', page.screenshot())


def main():
    """Take the screenshots of a recorded run at its best moment."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('out_dir', type=Path, help='a folder with record.jsonl of a demo')
    args = parser.parse_args()
    snapshots, plan, left = best_moment(args.out_dir)
    server = PageServer(snapshots, '127.0.0.1', 0)
    server.start()
    FOLDER.mkdir(exist_ok=True)
    with chromium.started(chromium.find()) as browser:
        page = browser.new_page(viewport={'width': 1440, 'height': 900}, color_scheme='dark')
        chromium.open_page(page, server.address)
        take(page, plan, left)
    server.stop()


if __name__ == '__main__':
    main()
