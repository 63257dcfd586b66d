"""``python -m uavrt.cli``: the ``uavrt`` command."""

from uavrt.cli.app import main

main()
