"""Draw docs/pictures/graph.png, the picture of the node graph: scripts/run-python docs/pictures/draw_graph.py.

The nodes, their colours and what they publish are those of `GRAPH`; the places are chosen here.
"""

from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.patches import FancyBboxPatch

from rf_pointing.ros.graph import GRAPH

KEPT, SIMULATED, INK = "#dbe9f6", "#fde8cf", "#1b2733"
WIDTH, HEIGHT = 2.5, 0.62
PLACES = {
    "ephemeris_publisher": (1.5, 6.2),
    "bias_calibrator": (1.5, 3.0),
    "pointing_controller": (5.6, 6.2),
    "monopulse_tracker": (4.5, 4.5),
    "conscan_tracker": (7.2, 4.5),
    "antenna_servo": (10.4, 6.2),
    "rf_receiver": (10.4, 4.5),
    "simulation_clock": (10.4, 3.0),
}
# from, to, label, start offset, end offset, label position, curvature
ARROWS = [
    ("ephemeris_publisher", "pointing_controller", "target", (1.25, 0.0), (-1.25, 0.0), (3.55, 6.35), 0.0),
    ("ephemeris_publisher", "bias_calibrator", "target", (-0.6, -0.31), (-0.6, 0.31), (0.9, 4.6), 0.0),
    ("bias_calibrator", "pointing_controller", "pointing_model", (0.3, 0.31), (-1.1, -0.31), (3.0, 5.0), -0.15),
    ("monopulse_tracker", "bias_calibrator", "pointing_error", (-0.6, -0.31), (1.25, 0.0), (3.7, 3.5), -0.15),
    ("monopulse_tracker", "pointing_controller", "pointing_error", (0.2, 0.31), (-0.4, -0.31), (4.95, 5.35), 0.0),
    ("conscan_tracker", "pointing_controller", "pointing_error", (-0.2, 0.31), (0.7, -0.31), (6.65, 5.35), 0.0),
    ("pointing_controller", "antenna_servo", "joint_trajectory", (1.25, 0.12), (-1.25, 0.12), (8.0, 6.47), 0.0),
    ("antenna_servo", "pointing_controller", "joint_states", (-1.25, -0.12), (1.25, -0.12), (8.0, 5.93), 0.0),
    ("antenna_servo", "rf_receiver", "sim/boresight", (0.0, -0.31), (0.0, 0.31), (10.4, 5.35), 0.0),
    ("rf_receiver", "conscan_tracker", "carrier_power", (-1.25, 0.0), (1.25, 0.0), (8.8, 4.98), 0.0),
    ("rf_receiver", "monopulse_tracker", "monopulse", (-1.0, -0.31), (0.6, -0.31), (7.3, 3.6), -0.22),
]


def main() -> None:
    """Draw and save."""
    figure, axes = plt.subplots(figsize=(11.6, 5.6), dpi=130)
    for node in GRAPH:
        x, y = PLACES[node.name]
        colour = SIMULATED if node.simulated else KEPT
        box = FancyBboxPatch(
            (x - WIDTH / 2, y - HEIGHT / 2), WIDTH, HEIGHT,
            boxstyle="round,pad=0.02,rounding_size=0.12", facecolor=colour, edgecolor=INK, linewidth=1.1,
        )  # fmt: skip
        axes.add_patch(box)
        axes.text(x, y, node.name, ha="center", va="center", fontsize=10.5, family="monospace", color=INK)
    published = {(node.name, topic.name) for node in GRAPH for topic in node.topics}
    for start, end, label, leave, arrive, place, curve in ARROWS:
        assert (start, label) in published, f"{start} does not publish {label}"
        first = (PLACES[start][0] + leave[0], PLACES[start][1] + leave[1])
        last = (PLACES[end][0] + arrive[0], PLACES[end][1] + arrive[1])
        style = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.1, "connectionstyle": f"arc3,rad={curve}"}
        axes.annotate("", xy=last, xytext=first, arrowprops=style)
        axes.text(*place, label, ha="center", va="center", fontsize=9, color=INK,
                  bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0})  # fmt: skip
    axes.text(10.4, 3.45, "clock: to every node", ha="center", fontsize=9, color=INK)
    notes = (
        "blue: stays with a real antenna      orange: the simulation, replaced by your own drivers",
        "one antenna = one namespace, for example /gs1; track_pass is an action of pointing_controller",
    )
    for row, note in enumerate(notes):
        axes.text(0.25, 2.2 - 0.35 * row, note, fontsize=9.5, color=INK)
    axes.set_xlim(0.1, 11.9)
    axes.set_ylim(1.6, 6.8)
    axes.axis("off")
    figure.savefig(Path(__file__).with_name("graph.png"), bbox_inches="tight")


if __name__ == "__main__":
    main()
