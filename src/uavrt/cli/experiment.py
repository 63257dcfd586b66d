"""``uavrt experiment``: claims as repeatable experiments, one module for each."""

from cyclopts import App

experiment = App(name="experiment", help="Repeat an experiment: claims that can be checked.")
# One line for each experiment; its module is imported when it is called.
experiment.command("uavrt.cli.experiment_capacity:capacity")
experiment.command("uavrt.cli.experiment_detection:detection")
experiment.command("uavrt.cli.experiment_localization:localization")
experiment.command("uavrt.cli.experiment_packets:packets")
experiment.command("uavrt.cli.experiment_recovery:recovery")
experiment.command("uavrt.cli.experiment_resources:resources")
experiment.command("uavrt.cli.experiment_rotation:rotation")
