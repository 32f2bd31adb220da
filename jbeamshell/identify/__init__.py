"""Parameters from measurements: least squares on the response, with uncertainty.

`fit` searches, and its `Fit` holds the values with their uncertainty; `Fit.profile` and
`Fit.posterior` tell more of it.  `fit_each` makes many fits, each on its own.  `read_plan` reads a
study from a file.  `compare` fits several laws of a joint to one target.  `Assembly` is a structure
with joints in place of a strip.
"""

from jbeamshell.identify.assembly import Assembly as Assembly
from jbeamshell.identify.comparison import compare as compare
from jbeamshell.identify.each import fit_each as fit_each
from jbeamshell.identify.parameters import Parameter as Parameter
from jbeamshell.identify.plan import fit as fit
from jbeamshell.identify.plan_file import read_plan as read_plan
from jbeamshell.identify.results import Fit as Fit
from jbeamshell.identify.specimens import Specimen as Specimen
