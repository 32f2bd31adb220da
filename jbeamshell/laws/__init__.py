"""Laws of a joint: a few numbers, and the force along any history of its displacement.

Each law is a pytree of its numbers, so that these can be fitted, swept and differentiated.  All
have `backbone`, `path_forces`, `dissipation` and `displacement`; `LAWS` holds them by name.

Examples
--------
>>> import jbeamshell as jb
>>> law = jb.laws.Iwan4(slip_force=2.0, stiffness=100.0, chi=-0.5, beta=0.3)
>>> law.path_forces([0.01, -0.01, 0.005])
"""

from jbeamshell.common.errors import InputError
from jbeamshell.laws.bar import Bar as Bar
from jbeamshell.laws.bouc_wen import BoucWen as BoucWen
from jbeamshell.laws.dahl import Dahl as Dahl
from jbeamshell.laws.iwan4 import Iwan4 as Iwan4
from jbeamshell.laws.jang_barber import JangBarber as JangBarber
from jbeamshell.laws.jenkins import Jenkins as Jenkins
from jbeamshell.laws.law import Law as Law
from jbeamshell.laws.lugre import LuGre as LuGre
from jbeamshell.laws.masing import MasingLaw as MasingLaw
from jbeamshell.laws.mindlin import Mindlin as Mindlin
from jbeamshell.laws.parallel_iwan import sliders as sliders

LAWS: dict[str, type[Law]] = {
    law.heading: law for law in (Jenkins, Iwan4, Bar, Mindlin, BoucWen, Dahl, LuGre, JangBarber)
}
"""Laws by the names that ``--model`` knows, besides "sliders4" and the like, see `law_named`."""


def law_named(name: str) -> type[Law]:
    """Law of a name in `LAWS`, or of some parallel sliders, such as "sliders4".

    Raises
    ------
    InputError
        for an unknown name
    """
    count = name.removeprefix("sliders") if isinstance(name, str) else ""
    if isinstance(name, str) and name.startswith("sliders") and count.isdecimal():
        return sliders(int(count))
    if not isinstance(name, str) or name not in LAWS:
        known = ", ".join(LAWS)
        raise InputError(f"model = {name!r}: choose {known}, or sliders with their count: sliders4")
    return LAWS[name]
