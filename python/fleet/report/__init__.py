"""The report of one flight: a single HTML file that needs no network."""

from fleet.report.page import write
from fleet.report.picture import draw

__all__ = ["draw", "write"]
