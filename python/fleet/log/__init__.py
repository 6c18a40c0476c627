"""Flight logs: one MCAP file a run, readable by Foxglove and by [read][fleet.log.read]."""

from fleet.log.flight import DroneLog, Flight, read
from fleet.log.merge import Mission, merge

__all__ = ["DroneLog", "Flight", "Mission", "merge", "read"]
