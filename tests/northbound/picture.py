"""The page as a picture: `python -m tests.northbound.picture docs/page.png`, with Debian's Chromium."""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.northbound.browser import Browser
from tests.northbound.shown_station import shown


def main(file: Path) -> None:
    """Five bays, one charging, one tripped, one held, one out of control and one empty."""
    with (
        TemporaryDirectory() as profile,
        TemporaryDirectory() as directory,
        Browser(Path(profile)) as browser,
        shown(Path(directory)) as station,
    ):
        tab = browser.tab(width=1360, height=760)
        tab.open(station.address, "document.querySelectorAll('.tile').length > 0")
        tab.picture(file)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
