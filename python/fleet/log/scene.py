"""Regions of a plan as triangles for Foxglove's 3-D panel."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet import _core
from fleet.scenario.region import Region

_IDENTITY = {
    "position": {"x": 0.0, "y": 0.0, "z": 0.0},
    "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
}
_COLORS = {
    "workspace": {"r": 0.6, "g": 0.6, "b": 0.6, "a": 0.03},
    "obstacle": {"r": 0.55, "g": 0.35, "b": 0.2, "a": 0.8},
    "home": {"r": 0.2, "g": 0.6, "b": 0.3, "a": 0.25},
    "target": {"r": 0.9, "g": 0.7, "b": 0.1, "a": 0.3},
}


def role(name: str, plan: _core.Plan) -> str:
    """What a region is for: `workspace`, `obstacle`, `home` or `target`."""
    if name == plan["workspace"]:
        return "workspace"
    if name in plan["obstacles"]:
        return "obstacle"
    return "home" if name.startswith("home.") else "target"


def vertices(region: Any) -> NDArray[np.float64]:
    """Corners of a plan's region, shape (k, 3) [m]."""
    faces = region["shape"]
    normals = np.array([face["a"] for face in faces], dtype=float)
    offsets = np.array([face["b"] for face in faces], dtype=float)
    return Region(region["name"], normals, offsets).vertices


def hull_triangles(corners: NDArray[np.float64]) -> NDArray[np.intp]:
    """Triangles of the convex hull as indices of corners, shape (n, 3)."""
    from scipy.spatial import ConvexHull

    triangles: NDArray[np.intp] = ConvexHull(corners).simplices.astype(np.intp)
    return triangles


def entity(region: Any, plan: _core.Plan, timestamp: dict[str, int]) -> dict[str, Any]:
    """One region as a `foxglove.SceneEntity`."""
    corners = vertices(region)
    points = corners[hull_triangles(corners)].reshape(-1, 3)
    return {
        "timestamp": timestamp,
        "frame_id": "map",
        "id": region["name"],
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": False,
        "metadata": [],
        "arrows": [],
        "cubes": [],
        "spheres": [],
        "cylinders": [],
        "lines": [],
        "triangles": [
            {
                "pose": _IDENTITY,
                "points": [{"x": x, "y": y, "z": z} for x, y, z in points.tolist()],
                "color": _COLORS[role(region["name"], plan)],
                "colors": [],
                "indices": [],
            }
        ],
        "texts": [],
        "models": [],
    }
