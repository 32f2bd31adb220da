"""The command line of the verification: ``python -m verification [NAME ...]``."""

import sys

from calibration.running import main

if __name__ == "__main__":
    sys.exit(main("verification"))
