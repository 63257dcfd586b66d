"""Constants of the search for unlisted senders: one frozen record for each step."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class PointTuning:
    """Constants for finding single pulses in a band."""

    window_s: float = 0.016
    """Length of the Hann window [s]; pulses of 2.5, 20 and 30 ms lose 3 to 5 dB in it."""
    hop_s: float = 0.008
    """Time from the start of one window of the spectrogram to the next [s]."""
    batch_s: float = 2.0
    """Duration over which a frequency's median power is taken as its noise level [s]."""
    most_cells: int = 12_500_000
    """Maximum number of spectrogram cells searched at once: 48 MiB, 2 s at 3 MS/s."""
    false_per_s: float = 3.0
    """Number of noise cells per second that may be accepted as pulses, in a band of up to
    `false_band_hz`; in wider bands it grows with the width."""
    false_band_hz: float = 100e3
    """Bandwidth above which the accepted number of noise cells grows with the width [Hz]."""
    segment_bins: int = 64
    """Number of adjacent frequency bins, 4 kHz; a rise in power that they have in common is not
    a pulse."""
    flank_bins: tuple[int, int] = (10, 17)
    """Distances in frequency from a pulse at which the spectrum of any pulse has decayed
    [bins]."""
    middle_bins: int = 5
    """Distance from a pulse's peak up to which its mean frequency is computed [bins]."""
    flank_ratio: float = 10.0
    """Minimum ratio of a pulse's peak power to the mean power at `flank_bins`."""
    around_frames: int = 13
    """Number of frames before and after a pulse for measuring its length: 104 ms."""
    longest_s: float = 0.1
    """Maximum duration of a detected pulse [s]; longer signals are transmissions."""
    least_frames: int = 16
    """Minimum number of spectrogram frames that are transformed together."""
    most_candidates: int = 200_000
    """Maximum number of cells that are examined in a batch; the strongest are chosen."""
    strong_db: float = 32.0
    """Level of a pulse over noise above which its edges may appear as separate pulses [dB]."""
    edge_s: float = 0.03
    """Maximum time between a pulse and the false pulses at its edges [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class IntervalTuning:
    """Constants for finding the interval of a sender from the times of detected pulses."""

    # Range of intervals searched [s]; tags on the market have 0.5 to 4 s.
    shortest_s: float = 0.25
    longest_s: float = 6.0
    fewest_pulses: int = 5
    """Minimum number of pulses with one interval for that interval to be accepted."""
    fewest_at_other_rate: int = 6
    """Minimum number of pulses at a second interval from which a chain is cut there."""
    most_bends: int = 6
    """Maximum degree of the polynomial that models the drift of a tag's interval with
    temperature."""
    most_false: float = 1e-4
    """Maximum expected number of equally good chains of pulses that noise forms in the
    recording."""
    tolerance_s: float = 0.022
    """Maximum deviation of a pulse from its expected time [s]: 20 ms of jitter, 2 ms of
    error."""
    most_missing: int = 6
    """Maximum number of consecutive missing pulses within a chain of a tag's pulses."""
    # Costs in a chain, relative to the value of a pulse. At `switch_cost` a stretch with every
    # second pulse missing counts as another rate from five or six pulses on at an end of the
    # recording, and from eight or nine in its middle.
    missing_cost: float = 0.3
    """Number of received pulses that one missing pulse cancels in the score of a chain, if the
    tag has one rate."""
    missing_or_switch_cost: float = 0.5
    """Number of received pulses that one missing pulse cancels in the score of a chain, if the
    tag may have changed its rate."""
    switch_cost: float = 2.0
    """Number of received pulses that one change of interval cancels in the score of a chain."""
    recent_pulses: int = 40
    """Number of recent pulses of a train over which its interval is averaged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainTuning:
    """Constants for sorting detected pulses into trains, each of one sender."""

    gather_hz: float = 150.0
    """Range of frequencies on each side that may belong to one tag as it warms up [Hz]."""
    step_hz: float = 25.0
    """Width of the frequency steps in which pulses are counted to find trains [Hz]."""
    fewest_held: int = 30
    """Minimum number of pulses from which a train in a live stream is kept while new pulses
    continue it."""
    renewing_ratio: float = 3.0
    """Ratio of new to old pulses at one frequency from which it is searched again."""
    renewing_share: float = 0.125
    """Maximum number of new pulses outside the known trains, as a share of the old pulses, with
    which the known trains are kept."""
    most_intervals: int = 8
    """Maximum number of intervals found among the pulses of one frequency."""
    strays: int = 2
    """Maximum number of pulses at one interval while their sender also sends at another."""
    most_scatter_hz: float = 30.0
    """Maximum scatter of a train's frequencies about a line [Hz]; unrelated pulses have
    87 Hz."""
    least_explained: float = 0.5
    """Minimum share of the pulses at a frequency that belong to trains; with less, the trains
    are doubtful."""
    same_time_s: float = 0.012
    """Maximum time between simultaneous pulses of two trains [s]."""
    image_share: float = 0.8
    """Minimum share of an image's pulses that coincide with those of a stronger train."""
    image_db: float = 3.0
    """Minimum level difference between a signal and its image, at frequencies where receivers
    produce images [dB]."""
    anywhere_db: float = 25.0
    """Minimum level difference between a signal and a simultaneous weaker train that counts as
    its image, at other frequencies [dB]."""
    one_device_db: float = 10.0
    """Maximum level difference between trains sent by one device, such as a data transmitter
    [dB]."""
    one_device_s: float = 0.001
    """Maximum difference between the intervals of trains sent by one device [s]."""
    flank_hz: float = 20_000.0
    """Distance from its source signal below which an image is not reported [Hz]."""
    burst_gap_s: float = 0.25
    """Minimum time between the last pulse of a burst and the first of the next [s]."""
    fewest_bursts: int = 3
    """Minimum number of bursts for a coded tag to be suspected."""
    most_in_burst: int = 8
    """Maximum number of pulses in a burst of a coded tag."""
    burst_share: float = 0.5
    """Minimum share of the pulses in bursts for a coded tag to be suspected."""
    most_bursts_per_s: float = 1.0
    """Maximum burst rate of a coded tag [1/s]; more frequent bursts are voice or data."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NamingTuning:
    """Constants for comparing trains with the listed tags."""

    reach_ppm: float = 70.0
    """Maximum frequency error of a radio without temperature-compensated crystal [ppm]."""
    edge_hz: float = 30.0
    """Tolerance for a train's frequency at the edge of a tag's search window [Hz]."""
    code_hz: float = 1000.0
    """Maximum distance of a coded tag's pulses from its nominal frequency [Hz]."""
    mirror_share: float = 0.25
    """Maximum distance of a tag from its mirror frequency, as a share of its distance from the
    listed frequency. Drift and an inaccurate label account for a few hundred hertz."""
    least_mirrored: float = 0.75
    """Minimum share of mirrored tags among all tags received off their label's frequency."""
    interval_ratios: tuple[float, ...] = (2.0, 1 / 2, 1 / 3)
    """Accepted ratios of the listed to the measured interval: two for a mortality signal at
    double rate; a half or a third if every second pulse, or two of three, are missed."""
    timing_s: float = 0.001
    """Error of a measured pulse interval due to the errors of the pulses' times [s]."""
    least_pulses: int = 8
    """Minimum number of pulses in a part of a train for it to have its own interval."""
    least_present: float = 0.7
    """Minimum share of the expected pulses that are received in a part of a train; a smaller
    share means that the part has another rate."""
    most_names: int = 3
    """Maximum number of listed tags reported as possible senders of a train."""
    gap_level_db: float = 12.0
    """Minimum level of pulses used to detect missing samples [dB]; noise rarely reaches it."""
    gap_pulses: int = 10
    """Minimum number of pulses for missing samples to be detected."""
    gap_share: float = 0.7
    """Minimum share of pulse-to-pulse times that are shorter than the tag's interval, from
    which samples count as missing."""
    most_missing_share: float = 0.4
    """Maximum share of a pulse interval that may be missing samples."""
    least_gap_spread_s: float = 0.02
    """Minimum scatter of the shortened pulse-to-pulse times [s]; with less scatter, the pulses
    belong to another train."""
    late_s: float = 0.025
    """Maximum delay of a pulse after its expected time, if samples are missing [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ListeningTuning:
    """Times and limits for searching a stream for unlisted senders."""

    tags_band_s: tuple[float, float, float] = (60.0, 20.0, 90.0)
    """Search of the tags' band in a recording: time searched at the start, time searched in
    each period, and length of the period [s]."""
    tags_band_live_s: tuple[float, float, float] = (60.0, 90.0, 90.0)
    """Search of the tags' band in a live stream: time searched at the start, time searched in
    each period, and length of the period [s]."""
    wide_hz: float = 800e3
    """Sample rate above which the tags' band is not searched all the time [Hz]."""
    wide_live_s: float = 30.0
    """Maximum time searched per period in the tags' band, if its sample rate is above `wide_hz`
    [s]."""
    whole_band_s: tuple[float, float, float] = (20.0, 20.0, 300.0)
    """Search of the radio's whole band in a recording: time searched at the start, time
    searched in each period, and length of the period [s]."""
    whole_band_live_s: tuple[float, float, float] = (40.0, 20.0, 540.0)
    """Search of the radio's whole band in a live stream: time searched at the start, time
    searched in each period, and length of the period [s]. In 40 s with pulses of 15 dB every 2
    s, at least `live_pulses` pulses are found."""
    live_cells: int = 4_000_000
    """Maximum number of spectrogram cells that are searched at once in flight: 0.7 s at 3 MS/s,
    in 15 MiB."""
    recent_s: float = 300.0
    """Duration of the newest part of a live stream that is searched for trains [s]."""
    most_points: int = 6000
    """Maximum number of a live stream's pulses searched for trains, the strongest ones."""
    report_every_s: float = 5.0
    """Time between two searches for trains of a live stream [s]."""
    live_pulses: int = 8
    """Minimum number of pulses of a train reported during a live stream."""
    clean_share: float = 0.45
    """Half-width of the searched part of a decimated band, as a share of its sample rate."""


POINTS = PointTuning()
INTERVALS = IntervalTuning()
TRAINS = TrainTuning()
NAMING = NamingTuning()
LISTENING = ListeningTuning()
