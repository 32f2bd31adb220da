"""Condensed contact: a linear elastic strip on its contact line, solved exactly in time.

`solve` walks the load path of a scene that is planned so, as `jbeamshell.solve` does; `dissipation`
gives the work of a steady cycle at many amplitudes from one factorisation, which `factors` keeps.
`jbeamshell.solve_contact` takes bodies from other programs.
"""

from jbeamshell.contact_line.cycles import CycleFactors as CycleFactors
from jbeamshell.contact_line.dissipation import dissipation as dissipation
from jbeamshell.contact_line.dissipation import factors as factors
from jbeamshell.contact_line.solve import solve as solve
