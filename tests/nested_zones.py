"""Nested slip zones by dense solves in NumPy, an oracle that shares no code with the walk."""

from typing import NamedTuple

import numpy as np


class Turn(NamedTuple):
    """Contact at a turn of the load, and the work of friction since the one before."""

    v: np.ndarray
    r_t: np.ndarray
    r_n: np.ndarray
    work: float


def nested(body, friction, turns):
    """Contact at the turns of a load whose slip zone grows node by node from the loaded end.

    Where m nodes slip, their slips d over the change of load F solve the first m rows of

        (K_tt + s mu K_nt) d = (f_t + s mu f_n) F - (r_t + s mu r_n),   s the sense of slip,

    and node m + 1 begins where its own slip in the next larger zone rises from zero.
    """
    k_tt, k_tn = np.asarray(body.K_tt), np.asarray(body.K_tn)
    f_t, f_n = np.asarray(body.f_t), np.asarray(body.f_n)
    k = f_t.size
    v, r_t, r_n, load = np.zeros(k), np.asarray(body.t_0), np.asarray(body.r_0), 0.0
    found = []
    for target in turns:
        sense, reach = np.sign(target - load), abs(target - load)
        matrix = k_tt + sense * friction * k_tn.T[:k]
        pull = sense * (f_t + sense * friction * f_n[:k])
        rest = -(r_t + sense * friction * r_n[:k])

        def slips(count, change, matrix=matrix, pull=pull, rest=rest):
            zone = slice(0, count)
            d = np.zeros(k)
            d[zone] = np.linalg.solve(matrix[zone, zone], rest[zone] + pull[zone] * change)
            return d

        events = [0.0]
        for count in range(1, k + 1):
            at_0, rate = slips(count, 0.0)[count - 1], slips(count, 1.0)[count - 1]
            begins = -at_0 / (rate - at_0)
            if not begins < reach:
                break
            assert begins > events[-1], "the zones are not nested"
            events.append(begins)
        events.append(reach)
        before_d, before_r, work = np.zeros(k), r_t, 0.0
        for count, change in enumerate(events[1:]):
            d = slips(count, change)
            now = r_t + k_tt @ d - f_t * sense * change
            work -= 0.5 * (before_r + now) @ (d - before_d)
            before_d, before_r = d, now
        v, r_t, load = v + before_d, before_r, target
        r_n = r_n + k_tn.T @ before_d - f_n * sense * reach
        found.append(Turn(v, r_t, r_n, work))
    return found
