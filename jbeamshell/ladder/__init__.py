"""Ladder of models: the cheapest rung that is accurate enough for a scene, and what it costs.

A rung is a model of the strip, from the bar to sections of order 6.  `advise` names the cheapest
rung within a tolerance, and `solve` runs it.
"""

from jbeamshell.ladder.advice import Advice as Advice
from jbeamshell.ladder.advice import advise as advise
from jbeamshell.ladder.climb import Option as Option
from jbeamshell.ladder.solving import solve as solve
