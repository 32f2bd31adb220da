"""Parameters from measurements: least squares on the response, with honest uncertainty.

`fit` searches, its `Fit` says what was found and what the data leave open, and `profile` asks the
model itself how far a parameter may go.  `read_plan` takes a whole study from a file.
"""

from jbeamshell.identify.experiment import Specimen as Specimen
from jbeamshell.identify.fitting import MAX_ITERATIONS as MAX_ITERATIONS
from jbeamshell.identify.fitting import METHODS as METHODS
from jbeamshell.identify.fitting import Progress as Progress
from jbeamshell.identify.fitting import fit as fit
from jbeamshell.identify.fitting import fit_kappa_s as fit_kappa_s
from jbeamshell.identify.likelihood import Profile as Profile
from jbeamshell.identify.likelihood import profile as profile
from jbeamshell.identify.parameters import Parameter as Parameter
from jbeamshell.identify.plan import Plan as Plan
from jbeamshell.identify.plan import read_plan as read_plan
from jbeamshell.identify.results import Fit as Fit
