"""Sweeps: figures of many strips that differ in some numbers; each strip is a lane."""

from jbeamshell.sweeping.lanes import Outcome as Outcome
from jbeamshell.sweeping.run import FIGURES as FIGURES
from jbeamshell.sweeping.run import sweep as sweep
