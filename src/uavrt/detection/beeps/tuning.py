"""Constants of the search for unlisted senders: one frozen record for each step."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class PointTuning:
    """Constants for finding single pulses in a band."""

    window_s: float = 0.016
    """Length of the Hann window [s]; the loss is 3 to 5 dB for pulses of 2.5, 20 and 30 ms."""
    hop_s: float = 0.008
    """Step from one window to the next [s]."""
    batch_s: float = 2.0
    """Duration over which the median gives the usual level of a frequency [s]."""
    most_cells: int = 12_500_000
    """Most cells of the spectrogram searched at once: 48 MiB, 2 s at 3 MS/s."""
    false_per_s: float = 3.0
    """Noise cells accepted as points in `false_band_hz` [1/s]; more in wider bands."""
    false_band_hz: float = 100e3
    """Widest band in which no more than `false_per_s` noise cells are accepted [Hz]."""
    segment_bins: int = 64
    """Number of neighbouring frequencies, 4 kHz, whose common rise is no pulse."""
    flank_bins: tuple[int, int] = (10, 17)
    """Distances at which the spectrum of a pulse has decayed, even one of 2.5 ms [bins]."""
    flank_ratio: float = 10.0
    """Least ratio of the peak of a pulse to the mean level at `flank_bins`."""
    around_frames: int = 13
    """Number of frames before and after a point from which its length is found: 104 ms."""
    longest_s: float = 0.1
    """Duration above which a signal is a transmission and no pulse [s]."""
    least_frames: int = 16
    """Least number of frames that are transformed together."""
    most_candidates: int = 200_000
    """Most cells of a batch that are examined: the strongest ones."""
    strong_db: float = 32.0
    """Level from which the edges of a pulse may make points of their own [dB]."""
    edge_s: float = 0.03
    """Largest time between the point of a pulse and those of its edges [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class IntervalTuning:
    """Constants for finding the interval of a sender from the times of points."""

    # Range of intervals searched [s]; tags on the market have 0.5 to 4 s.
    shortest_s: float = 0.25
    longest_s: float = 6.0
    fewest_pulses: int = 5
    """Least number of pulses that show an interval."""
    fewest_at_other_rate: int = 6
    """Least number of pulses at another interval at which a chain is cut."""
    most_bends: int = 6
    """Highest degree of the polynomial that follows the interval's change with temperature."""
    most_false: float = 1e-4
    """Largest expected number of equal chains from noise in the recording."""
    tolerance_s: float = 0.022
    """Largest deviation of a pulse from its place [s]: jitter of ± 20 ms, and our own error."""
    most_missing: int = 6
    """Most consecutive missing pulses in a chain."""
    # Costs in a chain, relative to the value of a pulse. At `switch_cost` a stretch with every
    # second pulse missing counts as another rate from five or six pulses on at an end of the
    # recording, and from eight or nine in its middle.
    missing_cost: float = 0.3
    """Cost of a missing pulse where the tag has one rate [values of a pulse]."""
    missing_or_switch_cost: float = 0.5
    """Cost of a missing pulse where the tag may have switched [values of a pulse]."""
    switch_cost: float = 2.0
    """Cost of a change of interval in a chain [values of a pulse]."""
    recent_pulses: int = 40
    """Number of recent pulses that give the running interval."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainTuning:
    """Constants for sorting points into trains, each of one sender."""

    gather_hz: float = 150.0
    """Range of frequencies that may belong to one tag as it warms up [Hz]."""
    step_hz: float = 25.0
    """Width of the steps in which points are counted by frequency [Hz]."""
    most_intervals: int = 8
    """Most intervals that are found among the points of one frequency."""
    strays: int = 2
    """Most points of a train within the time of another that one sender may explain."""
    most_scatter_hz: float = 30.0
    """Largest scatter of a train's frequencies about a line [Hz]; chance gives 87 Hz."""
    least_explained: float = 0.5
    """Least share of a frequency's points in trains; with less they are doubtful."""
    same_time_s: float = 0.012
    """Largest difference between the times of simultaneous pulses [s]."""
    image_share: float = 0.8
    """Least share of an image's pulses that coincide with those of a stronger train."""
    image_db: float = 3.0
    """Least level by which an image is below its original, where receivers make images [dB]."""
    anywhere_db: float = 25.0
    """Least level by which an image is below its original at any other frequency [dB]."""
    one_device_db: float = 10.0
    """Largest difference in level of the tones of one device, such as a data sender [dB]."""
    one_device_s: float = 0.001
    """Largest difference between the intervals of the tones of one device [s]."""
    flank_hz: float = 20_000.0
    """Distance within which an image is not reported, but taken as a flank or product [Hz]."""
    burst_gap_s: float = 0.25
    """Distance above which two pulses belong to two bursts [s]."""
    fewest_bursts: int = 3
    """Least number of bursts at which a coded tag is suspected."""
    most_in_burst: int = 8
    """Most pulses of a burst."""
    burst_share: float = 0.5
    """Least share of the points in bursts at which a coded tag is suspected."""
    most_bursts_per_s: float = 1.0
    """Largest rate of bursts of a coded tag [1/s]; more are voice or data."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NamingTuning:
    """Constants for comparing trains with the listed tags."""

    reach_ppm: float = 70.0
    """Error of a dongle without a temperature-compensated crystal [ppm]."""
    edge_hz: float = 30.0
    """Error of a train's frequency, and of the edge of a window [Hz]."""
    code_hz: float = 1000.0
    """Distance from a coded tag's frequency within which pulses are taken as its own [Hz]."""
    interval_ratios: tuple[float, ...] = (2.0, 1 / 2, 1 / 3)
    """Possible ratios of the listed to the measured interval: twice for a mortality signal at
    double rate, a half or a third if every second pulse, or two of three, are missed."""
    timing_s: float = 0.001
    """Error of an interval from the times of points [s]."""
    least_pulses: int = 8
    """Least number of pulses of a stretch with an interval of its own."""
    least_present: float = 0.7
    """Least share of received pulses in a stretch; fewer may belong to another rate."""
    most_names: int = 3
    """Most listed tags that are reported for a train."""
    gap_level_db: float = 12.0
    """Least level of pulses that may show missing samples [dB]; noise has few of these."""
    gap_pulses: int = 10
    """Least number of pulses that may show missing samples."""
    gap_share: float = 0.7
    """Least share of steps from pulse to pulse that are a little shorter than the interval."""
    most_missing_share: float = 0.4
    """Largest part of an interval whose samples may be missing between two pulses."""
    least_gap_spread_s: float = 0.02
    """Least scatter of the steps [s]; with less they are a train of their own."""
    late_s: float = 0.025
    """Largest delay of a pulse where samples are missing [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ListeningTuning:
    """Times and amounts of the search of a stream for unlisted senders."""

    tags_band_s: tuple[float, float, float] = (60.0, 20.0, 90.0)
    """Search of the tags' band of a recording: first time, time per period, period [s]."""
    tags_band_live_s: tuple[float, float, float] = (60.0, 45.0, 90.0)
    """Search of the tags' band of a live stream: first time, time per period, period [s]."""
    whole_band_s: tuple[float, float, float] = (20.0, 20.0, 300.0)
    """Search of the radio's wider band: first time, time per period, period [s]."""
    whole_band_live_s: tuple[float, float, float] = (20.0, 20.0, 540.0)
    """Search of that band of a live stream: first time, time per period, period [s]."""
    live_cells: int = 4_000_000
    """Most cells searched at once in flight: 0.7 s at 3 MS/s, in 15 MiB."""
    recent_s: float = 300.0
    """Duration of a live stream that is searched for trains [s]."""
    most_points: int = 6000
    """Most points searched for trains while a stream runs: the strongest ones."""
    report_every_s: float = 5.0
    """Time between two searches for trains of a live stream [s]."""
    live_pulses: int = 8
    """Least number of pulses of a train that is reported while a stream runs."""
    clean_share: float = 0.45
    """Half-width of a decimated band that is searched, as a share of its rate."""


POINTS = PointTuning()
INTERVALS = IntervalTuning()
TRAINS = TrainTuning()
NAMING = NamingTuning()
LISTENING = ListeningTuning()
