"""Resource use of the original system (thesis §5.2), for comparison.

Per cent of one core as ``top`` shows them, one tag, at 1, 5, 10, 15, 20, 25 and 30 minutes:
Table 5.2 (UDOO X86 II Ultra, Pentium N3710, 4 cores) and Table 5.5 (Dell Precision T1700, Xeon
E3-1240 v3). Memory in per cent of 8 and 16 GB: Tables 5.3 and 5.6.
"""

MINUTES = (1, 5, 10, 15, 20, 25, 30)

UDOO_CPU: dict[str, tuple[float, ...]] = {
    "channelizer": (170.1, 167.1, 162.0, 154.2, 166.3, 158.8, 158.3),
    "airspy_rx": (22.9, 22.3, 21.3, 22.6, 21.7, 21.6, 22.3),
    "uavrt_detection": (16.9, 16.7, 19.6, 16.3, 17.6, 17.3, 15.0),
    "csdr": (9.0, 8.7, 9.7, 9.3, 9.0, 8.6, 9.3),
    "uavrt_connection": (3.3, 3.3, 3.3, 2.8, 3.0, 3.1, 3.7),
    "uavrt_supervisor": (3.3, 2.7, 3.0, 3.0, 3.3, 2.7, 2.7),
    "netcat": (5.3, 5.7, 4.7, 5.3, 5.0, 5.0, 5.0),
}
DELL_CPU: dict[str, tuple[float, ...]] = {
    "channelizer": (473.8, 471.3, 481.0, 486.0, 464.1, 487.4, 482.0),
    "airspy_rx": (7.3, 7.6, 7.3, 7.7, 7.6, 7.0, 7.3),
    "uavrt_detection": (6.7, 7.0, 6.7, 7.0, 7.7, 6.0, 6.3),
    "csdr": (3.7, 3.0, 3.3, 3.0, 2.7, 3.0, 3.0),
    "uavrt_connection": (2.0, 1.3, 2.0, 2.3, 2.0, 2.0, 2.3),
    "uavrt_supervisor": (1.3, 1.7, 1.3, 1.3, 2.0, 1.3, 1.3),
    "netcat": (0.7, 0.3, 0.3, 0.7, 0.3, 0.3, 0.3),
}
EXTRAPOLATED_TAGS = 10
"""Number of detectors that the thesis gives as the UDOO's theoretical maximum (end of §5.2)."""
