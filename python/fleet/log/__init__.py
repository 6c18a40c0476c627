"""Flight logs: one MCAP file a run, readable by Foxglove and by [read][fleet.log.read]."""

from fleet.log.flight import DroneLog, Flight, Mission, assemble, is_complete, read
from fleet.log.merge import merge

__all__ = ["DroneLog", "Flight", "Mission", "assemble", "is_complete", "merge", "read"]
