"""``uavrt experiment``: repeatable experiments for published claims, one module for each."""

import sys

from cyclopts import App

EXPERIMENTS = {
    "autopilots": "Rehearse every order and takeover on the autopilots that will fly.",
    "capacity": "Packet loss in an autopilot's forwarding, 0 to 10 ms apart (thesis §5.4).",
    "constants": "Change the estimators' constants by 30 %: which ones change a result?",
    "coverage": "Check maps of silence: are areas as empty as the map says?",
    "detection": "Compare the detector with its target figures, the original and theory.",
    "integrate": "Judge whole flights: false alarms, range, place and cost.",
    "localization": "Compare bearings and positions with their target figures and theory.",
    "packets": "Compare the drone's log with the ground's, pulse by pulse (thesis §5.3).",
    "recovery": "Kill every process: how fast is it back, and are pulses lost?",
    "resources": "Measure CPU and memory of each process in a long flight (thesis §5.2).",
    "rotation": "Turn the antenna on the spot: why was it 50 degrees off (thesis §5.5)?",
    "search": "Compare planners that find animals on their own with the published tables.",
}
"""Summary of each experiment, by the module that is imported when it is called."""

experiment = App(name="experiment", help="Repeat an experiment, to check our claims.")
_called = next((word for word in sys.argv[2:] if word in EXPERIMENTS), None)
for _name, _text in EXPERIMENTS.items():
    _function = f"uavrt_experiments.commands.{_name}:{_name}"
    experiment.command(_function, help=None if _called else _text)
