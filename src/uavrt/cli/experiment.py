"""``uavrt experiment``: claims as repeatable experiments, one module for each."""

import sys

from cyclopts import App

EXPERIMENTS = {
    "capacity": "Packets through an autopilot's forwarding, 0 to 10 ms apart (thesis §5.4).",
    "detection": "The detector against its bars, the original and the bounds of theory.",
    "localization": "Bearings and positions against their bars and the bounds of theory.",
    "packets": "The drone's log against the ground's, pulse by pulse (thesis §5.3).",
    "recovery": "Every process killed: how fast it is back, whether a pulse is lost.",
    "resources": "CPU and memory of each process in a long flight (thesis §5.2).",
    "rotation": "The antenna turned on the spot: where 50 degrees came from (thesis §5.5).",
    "search": "Planners that find animals by themselves, against the published tables.",
}
"""The module of each is imported when it is called; its own text then stands for the line."""

experiment = App(name="experiment", help="Repeat an experiment: claims that can be checked.")
_called = next((word for word in sys.argv[2:] if word in EXPERIMENTS), None)
for _name, _text in EXPERIMENTS.items():
    experiment.command(f"uavrt.cli.experiment_{_name}:{_name}", help=None if _called else _text)
