"""Constants for testing groups and following tags: one frozen record for each step.

Powers are in units of the noise power, odds are natural logarithms (explanation/detection.md).
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class BandTuning:
    """Constants for searching the columns of a band, and estimating its noise."""

    noise_batches: int = 3
    """Number of batches between updates of the noise estimate; each update costs time."""
    least_noise_s: float = 0.35
    """Minimum duration of samples used to estimate the noise [s]."""
    least_clean: float = 0.2
    """Minimum share of columns without impulses from which only these columns are used to
    estimate the noise; below it, all columns are used."""
    delay_s: float = 0.07
    """Delay of the newest spectrogram columns behind the samples [s]: a window and a filter."""
    kept_s: float = 4.0
    """Time for which noise levels are stored after a group's span, to measure pulses [s]."""
    young_s: float = 2.5
    """Duration at the start in which each batch estimates the noise from all columns [s]."""
    many_lines_margin: float = 1.025
    """Factor on a threshold while many carriers are removed: their residuals vary over the
    channel, which gave 1.6 times the nominal false groups."""
    most_tracks: int = 12
    """Maximum number of tracks of one detector; beyond it, the least certain is dropped."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgeTuning:
    """Constants for distinguishing a candidate's pulses from other signals."""

    uniformity: float = 0.3
    """Minimum power of a pulse in a short group, as a share of the group's strongest."""
    few_pulses: int = 3
    """Largest number K of pulses in a group for which a weak pulse counts as missing."""
    strong_power: float = 30.0
    """Minimum power of a pulse that may be a stronger pulse's flank [noise powers]."""
    off_row_hz: float = 8.0
    """Difference of measured and searched frequency below which refinement ends [Hz]."""
    flank_ratio: float = 2.0
    """Maximum ratio of the power half a pulse or 35 Hz away to the pulse's own power."""
    lobe_ratio: float = 3.0
    """Minimum ratio of a signal's power to that of a pulse in its spectral side lobe."""
    weak_power: float = 4.0
    """Power below which a pulse's surroundings do not count against it [noise powers]."""
    loud_power: float = 8.0
    """Minimum power of a pulse that is tested for being an impulse [noise powers]."""
    most_flanks: float = 6.0
    """Maximum excess power on the flanks of a group's pulses [noise powers]. Noise exceeds it
    once in 300 000 windows; a tag with another interval often exceeds it."""
    pulses_per_foreign: int = 4
    """Minimum number of pulses in a group for each pulse that may belong to another sender."""
    flank_bins: float = 1.9
    """Distance in frequency within which the maximum of a strong pulse is searched [bins].
    Without this search, one group of 50 dB in twenty was measured on its flank, 6 dB too low,
    because cells are limited."""
    crossing_widths: float = 0.5
    """Excess over the tag's interval bound up to which intervals are tried [pulse widths]."""
    crossing_lead: float = 10.0
    """Lead in power at which another interval is accepted [noise powers]. A tag whose interval
    is at its bound stays below it: an interval 0.375 ms beyond the bound loses more power than
    noise adds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoundTuning:
    """Maximum deviations of a group or track from a tag's declared values."""

    clock_error: float = 3.0e-4
    """Relative error of the sample clock, added to the uncertainty of a tag's interval."""
    edge_bins: float = 0.5
    """Distance outside the search band at which a pulse is accepted [bins]: half a spectrum."""
    timing_sigmas: float = 2.5
    """Tolerance for a pulse's timing error due to noise [standard deviations]."""
    line_sigmas: float = 3.0
    """Tolerance for an interval measured by a line through pulse times [standard
    deviations]."""
    known_share: float = 0.5
    """Largest error of a long group's interval at confirmation, as a share of its bound."""
    same_transmitter_hz: float = 40.0
    """Maximum frequency difference between two tracks of one transmitter [Hz]."""
    same_group_hz: float = 100.0
    """Maximum frequency difference between untracked groups of one tag [Hz]."""
    active_intervals: float = 5.0
    """Time since a track's last pulse up to which the track counts as active [intervals]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BurstRateTuning:
    """Constants for counting bursts of other transmitters."""

    noise_sigmas: float = 3.0
    """Excess of the number of bursts over that expected in noise, above which they count
    [standard deviations]."""
    memory_s: float = 30.0
    """Time for which bursts of other transmitters are stored [s]; radio calls last some
    seconds."""
    most_kept: int = 3000
    """Maximum number of other transmitters' bursts stored, sufficient to measure their rate."""
    most_pending: int = 6000
    """Maximum number of strong cells stored between two updates of the burst rate."""
    windows_s: tuple[float, float, float] = (4.0, 10.0, 30.0)
    """Durations over which the rate of bursts is measured [s]; the highest rate is used."""
    pooled_s: float = 2.0
    """Weight of the whole band's burst rate, as a duration at the track's frequency [s]."""
    similar_db: float = 8.0
    """Maximum level difference between a pulse and a burst that may be mistaken for it [dB]."""
    near_rows: float = 2.6
    """Maximum frequency difference between a pulse and a burst that may be mistaken for it
    [spectrogram rows]: 30 Hz."""
    pair_s: float = 0.012
    """Tolerance in the time between two bursts an interval apart, as in periodic frames [s]."""
    least_phases: int = 3
    """Minimum number of different phases at which bursts repeat after the tag's interval; a
    tag's own pulses have fewer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChanceTuning:
    """Assumptions for the odds that a track is a tag and not a chance series of bursts."""

    received_share: float = 0.75
    """Assumed share of a tag's pulses that are detected; one in four is lost to fading."""
    period_s: float = 200.0
    """Time to which the allowed number of false tracks from bursts refers [s]."""
    confirmed_falsely: float = 1e-3
    """Number of tracks of chance bursts that may be confirmed in `period_s`."""
    frequency_hz: float = 7.0
    """Assumed scatter of a tag's frequencies about its track, at 14 dB with drift [Hz]."""
    power_db: float = 7.0
    """Assumed scatter of a tag's power relative to its last pulses while the antenna turns
    [dB]."""
    hidden_widths: float = 3.0
    """Distance in time within which a stronger burst hides a pulse [pulse widths]."""
    quiet_per_s: float = 1e-4
    """Assumed rate of bursts at a frequency where none were received [1/s]; ten times this rate
    is assumed in a band. Two pulses at the tag's interval outweigh it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowTuning:
    """Constants for confirming, following and ending a track."""

    slide_pulses: int = 6
    """Number of pulses from which the slide of a tag's frequency is measured."""
    slide_gain: float = 1.3
    """Minimum gain of energy by a slide for it to be the tag's; a slide of 140 Hz has it for a
    pulse of 20 ms, and noise does not."""
    confirm_false: float = 0.0005
    """Probability per test that noise confirms a tentative track; over all tests of a track it
    is 0.2 to 0.6 %."""
    confirm_long_false: float = 0.002
    """Probability per test that noise confirms a tentative track with K above `most_alone`."""
    more_tests: int = 2
    """Number of tests of a new track in addition to K; at 9 dB they raise the share of
    confirmed tracks from a half to three quarters."""
    follow_false: float = 0.01
    """Probability that noise is accepted as a confirmed track's pulse, per K intervals."""
    most_tests: int = 40
    """Maximum number of tested pulses of a track that exceeds noise but may be bursts."""
    odds_lost: float = 4.0
    """Fall of a track's log odds from their maximum at which the track ends: three missing
    pulses."""
    most_missed: int = 10
    """Maximum number of consecutive missed pulses of a track; more end it."""
    first_trust: float = 3.0
    """Log odds that a track just confirmed is a tag; three missing pulses end it."""
    most_trust: float = 15.0
    """Maximum log odds that a track is a tag; from there, ten missing pulses end the track, as
    many as `most_missed`."""
    trust_lost: float = 1.4
    """Maximum loss of a track's log odds of being a tag by one missed pulse; one pulse in four
    is lost to fading."""
    trust_won: float = 4.0
    """Maximum gain of a track's log odds of being a tag that one received pulse can give."""
    joint_trust: float = 6.0
    """Log odds that a track is a tag, above which a weak pulse is accepted by its sum with
    others. At lower odds the sum would include the pulses that began the track; these were
    chosen as the largest of many, so a third of noise would be accepted."""
    sure_trust: float = 10.0
    """Log odds of being a tag above which a track's pulses are certainly no bursts."""
    most_alone: int = 8
    """Maximum K for which single pulses are evidence for a track; longer groups use sums."""
    # Log-likelihood ratio of a pulse of 9 dB to noise by a cell's power: the line along
    # log I0(2 sqrt(8 P)) - 8 from P = 4 to 14, within 0.6.
    power_slope: float = 0.93
    power_start: float = -1.9
    more_cells: float = 5.0
    """Factor on the number of independent cells in a pulse's window, as every sample and
    frequency is examined, with interpolation. Measured on maxima of noise."""
    weakest_power: float = 3.0
    """Power below which a pulse is mostly noise and is not reported [noise powers]."""
    weakest_share: float = 0.35
    """Minimum power of a group's pulse as a share of the strongest pulse's; a weaker one may be
    noise."""
    joint_ratio: float = 2.0
    """Maximum power with which another pulse counts in the sum that supports a weak pulse,
    relative to the power of the weak pulse."""
    joint_share: float = 0.2
    """Minimum power of a weak pulse as a share of the strongest of its group."""
    # Log odds at every second place and at the others that mean twice the interval, with noise
    # between the pulses.
    empty_half: float = -2.5
    full_half: float = 4.0
    half_kept: float = 0.85
    """Factor by which each new pulse reduces the earlier log odds that the tag sends at even,
    or at odd, pulse numbers."""
    half_false: float = 0.01
    """Factor on the allowed number of false pulses at numbers where the tag does not send."""
    sure_power: float = 12.0
    """Minimum power of three pulses, an interval apart, that confirm a track [noise powers]."""
    interval_walk: float = 1.5e-4
    """Standard deviation of the interval's change from pulse to pulse, as a share of the
    interval."""
    phase_walk_s: float = 0.3e-3
    """Standard deviation of the random shift in a pulse's time from one to the next [s]."""
    most_drift_hz: float = 15.0
    """Maximum change of frequency from pulse to pulse [Hz]; a warming crystal has less."""
    steady_gain: float = 0.1
    """Gain of the slow average of a track's frequency, which scatters a quarter as much as
    single pulses."""
    past_pulses: int = 24
    """Number of past pulse times stored: more than three times a track's six slots."""
    whole_power: float = 20.0
    """Power below which a pulse near lost samples may have a break of phase [noise powers]."""
    broken_weight: float = 0.25
    """Weight of a pulse's measured frequency while samples are being lost. A phase break shifts
    the frequency by up to 20 Hz; with full weight, pulses were taken for bursts."""
    hiding_ratio: float = 2.0
    """Ratio of two tracks' pulse powers above which the stronger's pulse is subtracted."""
    hiding_bins: float = 0.8
    """Frequency difference below which another track may have the same pulses [bins]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RateTuning:
    """Constants for recognizing a tag's change between its two rates."""

    decisive_log: float = 8.0
    """Lead in log-likelihood that decides a tag's rate, as one clear pulse gives."""
    patience_intervals: float = 2.5
    """Maximum time for which a pulse waits for the decision on the tag's rate [longest
    intervals]; after that, it is reported as `detected`."""
    uncertainty_share: float = 0.25
    """Uncertainty of the interval after a change of rate, as a share of that declared."""
    most_starts: int = 8
    """Number of past pulses of a track at which a change of rate is considered."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GhostTuning:
    """Constants for recognizing spurious copies of a tag that the receiver produces."""

    stronger_ratio: float = 10.0**0.8
    """Minimum ratio of a tag's power to that of a spurious copy (ghost). An image is 25 to 40
    dB weaker. The strongest harmonic of a signal clipped to a square wave, the third, is 9.5 dB
    weaker. For an intermodulation product, both original signals are stronger by this ratio."""
    least_pulses: int = 3
    """Minimum number of pulses in a train that can be marked as a spurious copy (ghost) of a
    stronger tag."""
    mistaken_share: float = 1e-3
    """Maximum share of real tags that are taken for spurious copies (ghosts) although only
    their pulses coincide with another tag's."""
    edge_ratio: float = 100.0
    """Minimum ratio of a pulse's power to that of its edges at distant frequencies."""
    edge_noise: float = 2.5
    """Amplitude that the largest noise adds to a pulse's edge [noise amplitudes]."""
    edge_widths: float = 0.75
    """Maximum time between a pulse's start and its edge detected as a pulse [pulse widths]."""
    edge_share: float = 0.6
    """Minimum share of a train's pulses that lie at the edges of another train's pulses, for
    the train to count as those edges."""
    rounding_ns: int = 1000
    """Maximum rounding error of present-day times as floating-point numbers [ns]."""
    coincident_share: float = 0.9
    """Share of a spurious (ghost) train's pulses received together with the original's."""
    drift_steps: int = 32
    """Number of interval differences that average the probability of a chance coincidence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SenderTuning:
    """Constants for assigning trains of pulses to tags."""

    ruled_out_log: float = math.log(20.0)
    """Log-likelihood ratio above which another tag is ruled out as a train's sender."""
    interval_drift: float = 2e-3
    """Relative change of a tag's interval within a flight. Over the temperatures of a day,
    crystals of tags vary by 1e-4 and other oscillators by 1e-3."""
    interval_sigmas: float = 2.5
    """Tolerance of a train's interval beyond a tag's bound [standard deviations]."""
    bound_sigmas: float = 3.0
    """Number of standard deviations in a tag's declared bound of interval or frequency."""
    most_miss: float = 30.0
    """Limit on the squared deviation of a train's frequency from a tag's [variances]."""
    stay_log: float = 1.0
    """Log-likelihood ratio from which a train is assigned to a tag other than before."""
    any_tag_log: float = 50.0
    """Bonus on the log-likelihood for assigning any tag in place of none; it exceeds all
    differences between tags."""
    relearn_ns: float = 60e9
    """Time for which a tag must be received with another interval before it replaces the
    measured interval of the tag [ns]."""
    most_trains: int = 6
    """Maximum number of a band's trains assigned to tags; the last received are chosen."""
    kept_ns: int = 40_000_000_000
    """Time for which pulses of confirmed trains are stored [ns]; it exceeds that for other
    bursts."""
    small_ratios: tuple[tuple[int, int], ...] = ((2, 1), (3, 1), (3, 2))
    """Ratios of two tags' intervals at which common pulses fit both tags."""
    likely_odds: float = -6.0
    """Log odds above which an unconfirmed track counts as a tag and not as bursts."""
    same_train_share: float = 2.0 / 3.0
    """Minimum share of pulses that two tracks have in common if they belong to one train; a
    smaller share is a collision."""
    foreign_share: float = 2.0 / 3.0
    """Share of pulses that other trains explain above which a train is dropped."""
    foreign_pulses: int = 3
    """Minimum number of a train's pulses to drop it; fewer may coincide by accident."""
    same_interval_ratio: float = 1.2
    """Ratio of two tracks' intervals up to which they count as equal; each has a measuring
    error."""


BAND = BandTuning()
JUDGE = JudgeTuning()
BOUNDS = BoundTuning()
BURSTS = BurstRateTuning()
CHANCE = ChanceTuning()
FOLLOW = FollowTuning()
RATES = RateTuning()
GHOSTS = GhostTuning()
SENDERS = SenderTuning()
