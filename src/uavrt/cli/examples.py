"""Examples below the help of each command, in Markdown."""

EXAMPLES: dict[str, list[str]] = {
    "demo": [
        "uavrt demo",
        "uavrt demo --headless --json --duration 60",
        "uavrt demo --coded                              # two animals more, with coded tags",
        "uavrt demo --scenario world.toml",
    ],
    "run": [
        "uavrt run --config uavrt.toml",
        "uavrt run --tags TagInfo.txt --mavlink none     # no autopilot, no ground station",
    ],
    "ground": [
        "uavrt ground                                    # the page",
        "uavrt ground --mavlink serial:///dev/ttyUSB0:57600 --tags TagInfo.txt --start",
    ],
    "fly": [
        "uavrt fly rotate --seconds 60 --command-key drone.key",
        "uavrt fly goto 47.1013 8.5021 --height 60 --command-key drone.key",
        "uavrt fly search --radius 300 --tags 2,4 --height 60 --command-key drone.key",
        "uavrt fly stop --command-key drone.key",
    ],
    "detect": [
        "uavrt detect night.sigmf-meta --tags TagInfo.txt -o pulses.csv --plot pictures",
        "uavrt detect band.cf32 --tags tags.toml --sample-rate 3e6 --center-frequency 148.7e6",
        "airspy_rx -f 148.7 -r - -t 0 -a 3000000 |",
        "    uavrt detect - --tags tags.toml --sample-rate 3e6 --center-frequency 148.7e6",
    ],
    "bearing": [
        "uavrt bearing flights/flight_log_2026-05-01_08-15-00",
        "uavrt bearing placed.jsonl --antenna RA-2A --json",
    ],
    "localize": [
        "uavrt localize flights/flight_log_2026-05-01_08-15-00",
        "uavrt localize bearings.csv --method mle",
    ],
    "integrate": [
        "uavrt integrate flights/flight_log_2026-05-01_08-15-00 --tag 4 --plot folds",
        "uavrt integrate flights/flight_log_2026-05-01_08-15-00 --recording band.sigmf-meta",
    ],
    "range": [
        "uavrt range --tag-power -20 --height 60",
        "uavrt range --tag-power -25 --tags tags.toml --json",
    ],
    "coverage": [
        "uavrt coverage area.kml --tag-power -25 --dem N47E008.hgt --height 60 --height 100",
        "uavrt coverage flights/flight_log_2026-05-01_08-15-00 --tag-power -25 --area bog.kml",
    ],
    "batch": [
        "uavrt batch /archive/2025 --tags tags.toml -o searched",
        "uavrt batch old --manifest old/manifest.csv --tags tags.toml -o searched --workers 1",
    ],
    "archive list": ["uavrt archive list searched"],
    "archive tags": ["uavrt archive tags searched --json"],
    "archive export": ["uavrt archive export searched -o files --format geoparquet"],
    "archive query": [
        "uavrt archive query searched 'select flight, count(*) from pulses group by flight'"
    ],
    "attach": ["uavrt attach pulses.jsonl 00000042.BIN -o placed.jsonl --clock-offset 0"],
    "report": ["uavrt report flights/flight_log_2026-05-01_08-15-00"],
    "season": ["uavrt season uavrt-flights -o season.csv"],
    "export": [
        "uavrt export flights/flight_log_2026-05-01_08-15-00",
        "uavrt export old-log.csv --format gpx --format kmz -o for_tom",
    ],
    "fetch": [
        "uavrt fetch --list",
        "uavrt fetch --mavlink udpout://10.42.0.1:14560    # the newest flight, by Wi-Fi",
    ],
    "simulate": [
        "uavrt simulate demo -o world --duration 60 --sample-rate 250000",
        "uavrt simulate world/scenario.toml -o again --seed 2",
    ],
    "channelize": [
        "uavrt channelize                                # UDP 10000 in, all channels out",
        "uavrt channelize --channels 1,-46,100",
        "airspy_rx -f 148.71 -r - -t 0 -a 3000000 | uavrt channelize - --sample-rate 3e6",
    ],
    "monitor": ["uavrt monitor", "uavrt monitor --start TagInfo.txt", "uavrt monitor --stop"],
    "doctor": [
        "uavrt doctor",
        "uavrt doctor --flight                           # the list before a first flight",
        "uavrt doctor --autopilot --mavlink serial:///dev/ttyACM0:57600",
    ],
    "tags check": ["uavrt tags check TagInfo.txt"],
    "tags correct": ["uavrt tags correct tags.toml flights/flight_log_2026-05-01_08-15-00"],
    "tags convert": ["uavrt tags convert TagInfo.txt tags.toml"],
    "tags measure": [
        "uavrt tags measure tag.sigmf-meta -o tags.toml --name Luna",
        "uavrt tags measure tag.cf32 --sample-rate 3e6 --center-frequency 148.7e6",
    ],
    "update": [
        "cd /var/lib/uavrt && sudo /opt/uavrt/venv/bin/uavrt update uavrt-0.2.0.tar",
        "uavrt update uavrt-0.2.0.tar --check           # what is it, would it go?",
    ],
    "starter install": [
        "uavrt starter install --help  # where it goes",
        "uavrt starter install",
    ],
    "service install": ['sudo .venv/bin/uavrt service install --directory "$PWD"'],
}


def examples(name: str) -> str | None:
    """Examples of a command; None if there are none."""
    lines = EXAMPLES.get(name)
    return None if lines is None else "\n".join(("Examples:", "```sh", *lines, "```"))
