"""The command line of the studies: ``python -m calibration [NAME ...]``."""

import sys

from calibration.running import main

if __name__ == "__main__":
    sys.exit(main("calibration"))
