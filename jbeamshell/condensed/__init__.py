"""Condensed contact: a linear elastic strip on its contact line, solved exactly in time.

`solve` walks a load path of plane elasticity event by event; `dissipation` gives the work of a
steady cycle at many amplitudes from one factorisation.
"""

from jbeamshell.condensed.dissipation import dissipation as dissipation
from jbeamshell.condensed.solve import solve as solve
from jbeamshell.condensed.strip import NODES as NODES
