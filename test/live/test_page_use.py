# SPDX-License-Identifier: Apache-2.0
"""The live page by keyboard and screen reader, with long names, and with UAVs that come later."""
import pytest
from chromium import wait
from small_run import BEGIN, FIRST, Run, state

LONG = 'mast_of_the_northern_line_' * 7


@pytest.mark.parametrize('width', [390, 1600])
def test_a_long_name_of_a_uav_leaves_the_page_as_wide_as_the_window(view, width):
    lost = state(BEGIN, LONG, (300.0, 300.0), mode='FAULT')
    page = view(Run().add(*FIRST, lost).snapshots)
    page.set_viewport_size({'width': width, 'height': 844})
    wait(page, '#alarm', f'{LONG}: fault')
    assert page.evaluate('document.documentElement.scrollWidth') == width
