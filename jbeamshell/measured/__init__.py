"""Measured data: recordings of many cycles, steady loops, curves, and their readers.

`inspect` tells what a file holds, and what speaks against a fit of it.
`read_loops` reads the loops of a file unchanged, and `steady_loops` averages the cycles of a noisy
one.  `jbeamshell.identify` compares a strip or a law with a `Loop`,
`Backbone`, `DissipationCurve`, `StiffnessCurve` or `SqueezeCurve`, and a structure with a
`FrequencyCurve`, `DampingCurve` or `ForcedCurve`.
"""

from jbeamshell.measured.curve_files import read_curves as read_curves
from jbeamshell.measured.curves import Backbone as Backbone
from jbeamshell.measured.curves import DampingCurve as DampingCurve
from jbeamshell.measured.curves import DissipationCurve as DissipationCurve
from jbeamshell.measured.curves import ForcedCurve as ForcedCurve
from jbeamshell.measured.curves import FrequencyCurve as FrequencyCurve
from jbeamshell.measured.curves import SqueezeCurve as SqueezeCurve
from jbeamshell.measured.curves import StiffnessCurve as StiffnessCurve
from jbeamshell.measured.form import Measurement as Measurement
from jbeamshell.measured.inspection import Finding as Finding
from jbeamshell.measured.inspection import Inspection as Inspection
from jbeamshell.measured.inspection import inspect as inspect
from jbeamshell.measured.loop_files import read_loops as read_loops
from jbeamshell.measured.loops import Loop as Loop
from jbeamshell.measured.loops import make_loop as make_loop
from jbeamshell.measured.splitting import split_cycles as split_cycles
from jbeamshell.measured.steady import steady_loops as steady_loops
