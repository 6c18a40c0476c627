"""The mission planner: scenario to certified fleet plan (docs/design.md, The planner)."""

from .plan import plan
from .result import PlanResult, Status

__all__ = ["PlanResult", "Status", "plan"]
