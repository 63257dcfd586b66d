"""Connect the processes: records as JSON lines, samples as datagrams.

Each child has one stream socket to the supervisor, which routes records by the table of topics;
processes share nothing that a kill could corrupt. Samples bypass the supervisor: one pair of
Unix datagram sockets from the receiver to each detector (`uavrt.drone.ipc.sample_datagrams`,
the only module here that needs NumPy).
"""
