"""Constants of ordering and cleaning the samples: one frozen record for each step.

Shares and false alarms that a text quotes are measured: docs/explanation/detection.md.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelTuning:
    """Constants for joining the blocks of a channel, and comparing its frequencies."""

    reorder_s: float = 0.1
    """Longest wait for a sample block that one later block has overtaken [s]."""
    recent_blocks: int = 64
    """Number of recent blocks; the longest is the expected length of the next one."""
    restart_blocks: int = 3
    """Number of consecutive blocks with earlier times than expected after which the stream
    restarts."""
    # Shortest run of zeros that counts as lost samples; coarse samples contain shorter ones.
    shortest_loss_s: float = 0.0005
    shortest_loss_samples: int = 4
    least_received: float = 0.45
    """Minimum share of a window's samples that were received, for it to be evaluated."""
    floor_stride: int = 4
    """Step between the samples used for the median power, which gives the noise floor
    [samples]."""
    usual_error_hz: float = 500.0
    """Maximum usual error of a tag's frequency [Hz]."""
    edge_hz: float = 2.0
    """Distance beyond a channel's edge at which a track's frequency changes to the other edge
    [Hz]. It is more than twice the scatter of a track of 16 dB, so that a tag 5 Hz inside keeps
    its frequency."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CarrierTuning:
    """Constants for finding and subtracting carriers."""

    transform_s: float = 0.55
    """Length of the spectrum that finds steady carriers [s]: bins of 1.8 Hz."""
    search_every_s: float = 2.4
    """Interval between two searches for carriers while none is subtracted [s]. It is short
    because the fit of an amplitude cannot follow a drift of 2 Hz/s over 2.5 s."""
    fit_s: float = 0.3
    """Duration of earlier samples in the fit of a carrier's amplitude [s]."""
    block_s: float = 0.004
    """Length of the blocks within which a carrier's amplitude is taken as linear [s]."""
    degree: int = 7
    """Degree of the polynomial of a carrier's amplitude. A carrier of 60 dB with 30 % of
    modulation at 1.3 Hz leaves 20 dB at degree 4, and 0.5 dB at degree 6."""
    threshold_ratio: float = 40.0
    """Ratio of a bin's power to the median of the bins around it, above which it is a carrier.
    Noise reaches this in one of 10¹² bins; pulses, which are 50 Hz wide, reach a ratio of 4. A
    carrier of 0 dB in 50 Hz reaches the threshold."""
    group_bins: int = 16
    """Number of neighbouring frequency bins used to estimate their noise power."""
    floor_rank: int = 4
    """Rank, by power, of the bin that represents the noise of a group of bins. It is low
    because an idle transmitter with frames of 60 ms has a line every 16.7 Hz, which occupies
    half of the bins."""
    floor_scale: float = 2.0
    """Ratio of the median power of a group of noise bins to the power of the bin with the rank
    `floor_rank`."""
    most_lines: int = 240
    """Maximum number of carriers removed; frames of 60 ms cause one every 16.7 Hz."""
    few_lines: int = 6
    """Maximum number of carriers that are all fitted with polynomials of full degree."""
    many_lines: int = 100
    """Number of carriers above which weak carriers are fitted with polynomials of
    `degree_of_most`."""
    degree_of_many: int = 3
    """Polynomial degree for weak carriers if there are more than `few_lines`. 37 polynomials of
    degree 7 would remove a tenth of the noise, mostly from the newest samples. Degree 3 follows
    a line 1.5 Hz wide."""
    degree_of_most: int = 1
    """Polynomial degree for weak carriers if there are more than `many_lines`, as from an idle
    transmitter."""
    most_fit_steps: int = 10
    """Maximum number of conjugate-gradient steps in the common fit of all carriers."""
    residual_share: float = 0.02
    """Residual power of the carriers at which the fit ends, as a share of the noise power."""
    strong_ratio: float = 1e4
    """Minimum ratio of a strong carrier's bin to the median of the bins around it. A carrier
    of 24 dB in 50 Hz reaches it."""
    held_searches: int = 40
    """Number of searches, at most 0.44 s apart, for which a carrier is still subtracted after
    it was last found. A line of hum can fade for seconds. Its return caused 17 times the
    nominal false groups; with this number it causes 1.2 times (49 groups in 841 decisions at 5
    %)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WhiteningTuning:
    """Constants for tracking the noise density and making it flat."""

    reach_s: float = 0.008
    """Half-length of the whitening filter [s], which resolves 100 Hz."""
    segment_s: float = 0.034
    """Length of the windows that measure the noise density [s]: 44 Hz wide with Hann taper."""
    memory_s: float = 10.0
    """Duration over which the noise density is averaged [s]."""
    most_weight: float = 6.0
    """Maximum power with which a window counts in the average noise density [noise densities];
    a window may contain a pulse."""
    rise_ratio: float = 2.2
    """Ratio of the newest median to the average noise density, above which averaging starts
    again."""
    suppressed_ratio: float = 10.0
    """Ratio of a noise density to that in the tag's band, above which the filter divides only
    by the square root of the excess. After the filter, a neighbour at this ratio has the
    inverse ratio."""
    smoothed_bins: int = 5
    """Number of frequency bins over which the noise density is averaged."""
    coloured_ratio: float = 3.0
    """Ratio of the highest noise density to that in the tag's band, above which filtering
    begins."""
    plain_ratio: float = 2.0
    """Ratio of the highest noise density to that in the tag's band, below which filtering
    ends."""
    young_s: float = 2.0
    """Duration at the start in which the measured noise density has an error of a third [s]."""
    young_coloured_ratio: float = 6.0
    """Ratio of the highest noise density to that in the tag's band, above which filtering
    begins during `young_s`."""
    check_every: int = 4
    """Number of search steps between checks for white noise, or between new filters."""
    fewest_windows: int = 12
    """Minimum number of windows from whose median a rise of the noise density is detected."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SparkTuning:
    """Constants for recognizing bursts of mains noise and making them steady."""

    side_s: float = 0.0013
    """Half-length of the filters for the frequencies on both sides of the searched band [s]."""
    smooth_s: float = 0.0011
    """Half-length of the average of the noise level over time [s]; in a band of 1 kHz it
    averages three independent values."""
    guard_hz: float = 50.0
    """Distance of the noise filters' bands from the searched band, on both sides [Hz]."""
    least_width_hz: float = 300.0
    """Minimum width of the noise filters' bands [Hz]; a filter of a millisecond cannot be
    narrower."""
    quiet_quantile: float = 0.2
    """Quantile of the noise levels that represents the time between bursts of noise."""
    mean_ratio: float = 1.8
    """Ratio of the mean level of steady noise to its quiet quantile: 1.79, with a margin."""
    high_ratio: float = 5.0
    """Ratio of the noise level to its quiet quantile, above which it counts as high. Steady
    noise exceeds it in 0.8 % of the time, edges of 60 dB pulses in 1.3 %, and sparks with a
    mean power of 3 dB in 16 % or more."""
    sparking_share: float = 0.135
    """Share of high noise levels above which the samples are divided by the noise level; ten
    bursts of 5 ms a second give 0.1."""
    steady_share: float = 0.11
    """Share of high noise levels below which the samples are no longer divided by the noise
    level."""
    check_every: int = 8
    """Number of steps between checks for bursts while the noise is steady; a check takes a
    third of the time of a step."""
    share_gain: float = 0.2
    """Weight of the newest share of high noise levels in its running average."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OccupancyTuning:
    """Constants for measuring the share of usable time of a frequency."""

    apart_bins: float = 1.0
    """Distance of the examined frequencies from the tag's, on each side [bins]."""
    rise_s: float = 120.0
    """Time constant with which the quiet noise level may rise [s]."""
    loud_ratio: float = 24.0
    """Minimum ratio of an instant's power to the quiet level for the instant to count as
    occupied. The lowest quartile of a minute is about 0.3 of the mean noise, which hardly
    ever reaches this."""
    above_channel: float = 4.0
    """Ratio of the quiet level of a tag's frequency to that of the channel's quietest
    frequencies, up to which it may be noise. A higher ratio shows a steady signal."""
    channel_every: int = 4
    """Number of updates between two measurements of the channel's quietest frequencies."""
    group_bins: int = 8
    """Number of neighbouring frequency bins over which a level is averaged."""
    stride: int = 8
    """Step between the samples that are checked for losses, to measure occupancy [samples]."""
    least_received: float = 0.5
    """Minimum share of a window's samples, neither lost nor blanked, to measure occupancy."""


CHANNEL = ChannelTuning()
CARRIERS = CarrierTuning()
WHITENING = WhiteningTuning()
SPARKS = SparkTuning()
OCCUPANCY = OccupancyTuning()
