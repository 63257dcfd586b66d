"""Performance of the original, measured on its own program."""

PD = {6.0: 0.018, 7.0: 0.068, 8.0: 0.138, 9.0: 0.333, 10.0: 0.590, 11.0: 0.843, 12.0: 0.965}
"""Original's Pd by ENR [dB]: thesis's tag, K = 3, pf 1 %, n = 400."""
PD_5_PERCENT = {6.0: 0.04, 8.0: 0.20, 10.0: 0.74, 12.0: 0.99}
"""Original's Pd by ENR [dB]: thesis's tag, K = 3, pf 5 %."""
PD_TRACKER_5_PERCENT = {7.0: 0.07, 8.0: 0.13, 9.0: 0.38, 10.0: 0.67, 11.0: 0.89, 12.0: 0.98}
"""Original's Pd by ENR [dB] for the default tag of its ground station, pf 5 %, n = 150."""
PD_ONE_PULSE = {10.0: 0.09, 11.0: 0.17, 12.0: 0.38, 13.0: 0.62, 14.0: 0.82}
"""Original's Pd by ENR [dB]: K = 1, pf 1 %, n = 200."""
ENR_HALF_DB = 9.65
ENR_NINE_TENTHS_DB = 11.4
FALSE_ALARMS = {0.05: 1.19, 0.01: 1.04}
"""Original's ratio of found to nominal false alarms in white noise, K = 3, by the nominal
share."""
CONFIRMED_RECALL = {8.0: 0.02, 9.0: 0.17, 10.0: 0.43, 11.0: 0.64, 12.0: 0.87, 14.0: 0.97}
"""Share of the pulses of 300 s that the original confirmed, by ENR [dB]."""
FALSE_CONFIRMED_10_DB = 4.0
HALF_CONFIRMED_DB = 10.35
FIRST_CONFIRMED_14_DB_S = 4.1
TIME_RMS_MS = 3.0
FREQUENCY_RMS_HZ = 8.7
SNR_BIAS_DB = -1.4
RECALL_LOST_FRAMES = {1.0: 0.97, 5.0: 0.83}
"""Original's recall by the share of lost datagrams [%]."""
LATENCY_S = 7.5
COST_ONE_TAG_PERCENT = 1.2
"""Original's CPU use for one tag, in percent of one core; the lower end of the given range."""
