"""Draw docs/pictures/graph.png, the picture of the node graph: scripts/run-python docs/pictures/draw_graph.py.

The nodes, their colours and what they publish are those of `GRAPH`; the places are chosen here.
"""

from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.patches import FancyBboxPatch

from rf_pointing.nodes.graph import GRAPH

KEPT, SIMULATED, INK = "#dbe9f6", "#fde8cf", "#1b2733"
WIDTH, HEIGHT = 2.5, 0.62
PLACES = {
    "ephemeris_publisher": (1.5, 6.2),
    "bias_calibrator": (1.5, 3.6),
    "pointing_controller": (5.6, 6.2),
    "antenna_servo": (9.9, 6.2),
    "rf_receiver": (9.9, 3.6),
    "monopulse_tracker": (5.6, 4.1),
    "conscan_tracker": (5.6, 3.0),
    "simulation_clock": (9.9, 1.9),
}
ARROWS = [
    # from, to, label, start offset, end offset, label position, curvature
    ("ephemeris_publisher", "pointing_controller", "target", (1.25, 0.1), (-1.25, 0.1), (3.55, 6.45), 0.0),
    ("ephemeris_publisher", "bias_calibrator", "target", (0.3, -0.31), (0.3, 0.31), (2.2, 5.2), 0.0),
    (
        "bias_calibrator",
        "pointing_controller",
        "pointing_model\n(latched)",
        (1.25, 0.2),
        (-1.0, -0.31),
        (3.45, 5.05),
        0.0,
    ),
    ("pointing_controller", "antenna_servo", "joint_trajectory", (1.25, 0.15), (-1.25, 0.15), (7.75, 6.5), 0.0),
    ("antenna_servo", "pointing_controller", "joint_states", (-1.25, -0.15), (1.25, -0.15), (7.75, 5.8), 0.0),
    ("antenna_servo", "rf_receiver", "sim/boresight", (0.0, -0.31), (0.0, 0.31), (10.65, 4.9), 0.0),
    ("rf_receiver", "monopulse_tracker", "monopulse", (-1.25, 0.2), (1.25, 0.05), (7.75, 4.2), 0.0),
    ("rf_receiver", "conscan_tracker", "carrier_power", (-1.25, -0.2), (1.25, 0.0), (7.75, 3.05), 0.0),
    ("monopulse_tracker", "pointing_controller", "pointing_error", (0.35, 0.31), (0.35, -0.31), (6.75, 5.2), 0.0),
    (
        "monopulse_tracker",
        "bias_calibrator",
        "pointing_error,\njoint_states",
        (-1.25, 0.0),
        (1.25, -0.05),
        (3.5, 3.62),
        0.0,
    ),
    ("conscan_tracker", "pointing_controller", "", (-1.25, 0.05), (-0.5, -0.31), (0, 0), -0.33),
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
        # The first line names the topic; "(latched)" and a second source follow it.
        topic = label.split("\n")[0].rstrip(",")
        assert not topic or (start, topic) in published, f"{start} does not publish {topic}"
        first = (PLACES[start][0] + leave[0], PLACES[start][1] + leave[1])
        last = (PLACES[end][0] + arrive[0], PLACES[end][1] + arrive[1])
        style = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.1, "connectionstyle": f"arc3,rad={curve}"}
        axes.annotate("", xy=last, xytext=first, arrowprops=style)
        axes.text(*place, label, ha="center", va="center", fontsize=9, color=INK,
                  bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0})  # fmt: skip
    axes.text(9.9, 2.45, "clock: to every node", ha="center", fontsize=9, color=INK)
    axes.text(0.2, 1.75, "blue: stays with a real antenna     orange: the simulation, replaced by the station's own drivers",
              fontsize=9.5, color=INK)  # fmt: skip
    axes.text(0.2, 2.15, "one antenna = one namespace (/gs1); track_pass is an action of pointing_controller", fontsize=9.5,
              color=INK)  # fmt: skip
    axes.set_xlim(0.1, 11.5)
    axes.set_ylim(1.45, 6.8)
    axes.axis("off")
    figure.savefig(Path(__file__).with_name("graph.png"), bbox_inches="tight")


if __name__ == "__main__":
    main()
