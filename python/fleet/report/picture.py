"""A still picture of a flown mission (PNG), as in the README."""

from pathlib import Path

from fleet.log.flight import Flight
from fleet.log.scene import hull_triangles, role, vertices
from fleet.report import palette


def draw(flight: Flight, path: Path) -> None:
    """Draw regions and flown paths in 3-D and write them as PNG."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    plan = flight.plan
    figure = plt.figure(figsize=(9, 8), dpi=110)
    axes = figure.add_subplot(projection="3d", computed_zorder=False)
    colors = {"obstacle": palette.OBSTACLE, "target": palette.TARGET, "home": palette.HOME}
    for region in plan["regions"]:
        kind = role(region["name"], plan)
        if kind == "workspace":
            continue
        corners = vertices(region)
        faces = Poly3DCollection(
            corners[hull_triangles(corners)],
            facecolor=colors[kind],
            alpha=0.6 if kind == "obstacle" else 0.15,
            linewidth=0,
        )
        axes.add_collection3d(faces)
        if kind == "target":
            axes.text(*corners.mean(axis=0), region["name"], fontsize=8, ha="center")
    for index, (drone, log) in enumerate(flight.drones.items()):
        track = log.truth if len(log.truth) else log.state
        color = palette.drone_color(index)
        axes.plot(track[:, 1], track[:, 2], track[:, 3], color=color, linewidth=1.6, label=drone)
    corners = vertices(next(r for r in plan["regions"] if r["name"] == plan["workspace"]))
    low, high = corners.min(axis=0), corners.max(axis=0)
    axes.set(
        xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]),
        xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title=f"{plan['scenario']}, flown",
    )  # fmt: skip
    axes.set_box_aspect(high - low)
    axes.view_init(elev=18, azim=-52)
    axes.legend(loc="upper left")
    figure.savefig(path, bbox_inches="tight")
    plt.close(figure)
