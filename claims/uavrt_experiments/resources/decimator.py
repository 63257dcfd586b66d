"""The first stage in a separate process: from radio samples to the decimated band.

Used to compare shapes (`uavrt_experiments.resources.stages`); in flight the receiver does this
and the next stage in one process.
"""

from uavrt.core.messages import ChannelBlock, IQBlock
from uavrt.drone.processes.receiver import Receiver, run


class BandReceiver(Receiver):
    """A receiver that leaves the channels and their recording to another process."""

    makes_channels = False

    def _pass_on(self, band: IQBlock) -> None:
        """Send the band as if it were one channel."""
        if band.samples.size:
            self._sinks[0].send(
                ChannelBlock(
                    channel=0,
                    center_frequency_hz=self.center_frequency_hz,
                    samples=band.samples,
                    sample_index=band.sample_index,
                    time_ns=band.time_ns,
                    sample_rate_hz=band.sample_rate_hz,
                    lost_before=band.lost_before,
                )
            )


def main() -> None:
    """Run the decimator until it is stopped."""
    run(BandReceiver)


if __name__ == "__main__":
    main()
