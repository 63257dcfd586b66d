"""Services of a MAVLink component: file transfer, metadata, parameters, answers."""
