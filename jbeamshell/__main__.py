"""``python -m jbeamshell``, the command line."""

import sys

from jbeamshell.cli.main import main

sys.exit(main())
