"""Colours and order that page and picture share."""

DRONES = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#e377c2")
OBSTACLE = "#7a6652"
TARGET = "#e0a800"
HOME = "#3a9a5b"
WINDOW = "rgba(224, 168, 0, 0.12)"


def drone_color(index: int) -> str:
    """Colour of the drone with this place in the scenario."""
    return DRONES[index % len(DRONES)]
