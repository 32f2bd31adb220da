"""Laws of a joint: a few numbers, and the force along any history of its displacement.

Each law is a pytree of its numbers, so that these can be fitted, swept and differentiated.  All
have `backbone`, `path_forces`, `dissipation` and `displacement`; `LAWS` holds them by name.

Examples
--------
>>> import jbeamshell as jb
>>> law = jb.laws.Iwan4(slip_force=2.0, stiffness=100.0, chi=-0.5, beta=0.3)
>>> law.path_forces([0.01, -0.01, 0.005])
"""

from jbeamshell.laws.iwan4 import Iwan4 as Iwan4
from jbeamshell.laws.jenkins import Jenkins as Jenkins
from jbeamshell.laws.law import Law as Law
from jbeamshell.laws.masing import MasingLaw as MasingLaw

LAWS: dict[str, type[Law]] = {law.heading: law for law in (Jenkins, Iwan4)}
"""Laws by the names that ``--model`` knows."""
