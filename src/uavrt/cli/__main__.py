"""Run as ``python -m uavrt.cli``."""

from uavrt.cli.app import main

main()
