# SPDX-License-Identifier: Apache-2.0
"""Colours of UAVs, task states and zones in all figures and markers; needs no drawing library."""
from __future__ import annotations

# Okabe and Ito, "Color Universal Design": distinct with every kind of colour vision
BLUE, ORANGE, GREEN, PURPLE = '#0072b2', '#e69f00', '#009e73', '#cc79a7'
SKY_BLUE, VERMILION, YELLOW, BLACK = '#56b4e9', '#d55e00', '#f0e442', '#000000'
RED, DARK_RED = '#c62828', '#8e0000'  # zones and faults

# on a white ground; test/plots/test_plots.py measures that they and RED are distinct
UAV_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY_BLUE, BLACK, '#540078', '#c0b478')
UAV_COLOURS_ON_DARK = (BLUE, ORANGE, GREEN, PURPLE, SKY_BLUE, VERMILION)
STATE_COLOURS = {  # by name of the task state
    'PENDING': '#b0b0b0', 'ASSIGNED': SKY_BLUE, 'ACTIVE': ORANGE, 'UNASSIGNED': PURPLE,
    'COMPLETED': GREEN, 'FAILED': VERMILION, 'CANCELLED': '#7f7f7f', 'REJECTED': '#5e3c99'}
STATE_COLOURS_ON_DARK = {
    'PENDING': '#b0b0b0', 'ASSIGNED': SKY_BLUE, 'ACTIVE': YELLOW, 'UNASSIGNED': PURPLE,
    'COMPLETED': GREEN, 'FAILED': VERMILION}


def uav_colour(index: int) -> str:
    """Return the colour of a UAV; they repeat.

    Args:
        index: position in the fleet, from 0.

    Returns:
        `#rrggbb`.
    """
    return UAV_COLOURS[index % len(UAV_COLOURS)]


def rgb(colour: str) -> tuple[float, float, float]:
    """Split a colour into its components.

    Args:
        colour: `#rrggbb`.

    Returns:
        Red, green and blue, each in [0, 1].
    """
    red, green, blue = (int(colour[i:i + 2], 16) / 255.0 for i in (1, 3, 5))
    return red, green, blue
