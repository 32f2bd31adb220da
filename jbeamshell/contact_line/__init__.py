"""Condensed contact: a linear elastic strip on its contact line, solved exactly in time.

`solve` walks the load path of a scene that is planned so, as `jbeamshell.solve` does.
"""

from jbeamshell.contact_line.solve import solve as solve
