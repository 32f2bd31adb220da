"""Parameters of a scene from measurements: least squares on the response, with uncertainty.

`fit` searches, and its `Fit` holds the values with their uncertainty.  `fit_each` makes many fits,
each on its own, and `bootstrap` those of copies of one.  `profile` computes the
confidence interval of one parameter by running the model.  `posterior` is a density for samplers
of other libraries.  `read_plan` reads a study from a file.  `compare` fits several laws of a joint
to one target; `Driven` is such a law in place of a scene, driven by force or displacement.
`Assembly` is a structure with joints in place of a scene; `jointed` makes one of plain numbers.
"""

from jbeamshell.identify.assembly import Assembly as Assembly
from jbeamshell.identify.assembly import jointed as jointed
from jbeamshell.identify.comparison import Comparison as Comparison
from jbeamshell.identify.comparison import compare as compare
from jbeamshell.identify.each import Fits as Fits
from jbeamshell.identify.each import bootstrap as bootstrap
from jbeamshell.identify.each import fit_each as fit_each
from jbeamshell.identify.fitting import fit as fit
from jbeamshell.identify.models import Drive as Drive
from jbeamshell.identify.models import Driven as Driven
from jbeamshell.identify.parameters import Parameter as Parameter
from jbeamshell.identify.plan import Plan as Plan
from jbeamshell.identify.plan_file import read_plan as read_plan
from jbeamshell.identify.posterior import Posterior as Posterior
from jbeamshell.identify.posterior import posterior as posterior
from jbeamshell.identify.profile_likelihood import Profile as Profile
from jbeamshell.identify.profile_likelihood import profile as profile
from jbeamshell.identify.results import Fit as Fit
from jbeamshell.identify.specimens import Specimen as Specimen
