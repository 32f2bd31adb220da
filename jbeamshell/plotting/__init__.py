"""Pictures of load paths (loop, profiles along X, contact), fits, motions and sweeps.

Only this package imports matplotlib. Every function draws into the axes it is given or into new
ones and returns them; it neither shows them nor changes matplotlib's settings. `style` gives your
own figures the same look. Pictures import no class of results: any object with the attributes of
the class that a docstring names can be drawn.

>>> axes = plotting.loop(jb.solve(jb.Scene()))
>>> plotting.save(axes.figure, "loop.png")
"""

from jbeamshell.plotting.comparisons import comparison as comparison
from jbeamshell.plotting.contacts import contact as contact
from jbeamshell.plotting.contacts import contact_map as contact_map
from jbeamshell.plotting.faces import face_map as face_map
from jbeamshell.plotting.films import Film as Film
from jbeamshell.plotting.films import animate as animate
from jbeamshell.plotting.fits import likelihoods as likelihoods
from jbeamshell.plotting.fits import overlay as overlay
from jbeamshell.plotting.fits import residuals as residuals
from jbeamshell.plotting.inspections import inspection as inspection
from jbeamshell.plotting.joints import deformed as deformed
from jbeamshell.plotting.joints import lap_joint as lap_joint
from jbeamshell.plotting.motions import energies as energies
from jbeamshell.plotting.motions import modal_curve as modal_curve
from jbeamshell.plotting.motions import ring_down as ring_down
from jbeamshell.plotting.motions import ring_down_sheet as ring_down_sheet
from jbeamshell.plotting.motions import spectrogram as spectrogram
from jbeamshell.plotting.motions import vibration as vibration
from jbeamshell.plotting.paths import contact_lines as contact_lines
from jbeamshell.plotting.paths import loop as loop
from jbeamshell.plotting.paths import profiles as profiles
from jbeamshell.plotting.responses import forced_response as forced_response
from jbeamshell.plotting.style import DATA as DATA
from jbeamshell.plotting.style import DISPLACEMENT as DISPLACEMENT
from jbeamshell.plotting.style import DOTS as DOTS
from jbeamshell.plotting.style import FAINT as FAINT
from jbeamshell.plotting.style import FORCE as FORCE
from jbeamshell.plotting.style import PALETTE as PALETTE
from jbeamshell.plotting.style import POSITION as POSITION
from jbeamshell.plotting.style import SQUEEZE as SQUEEZE
from jbeamshell.plotting.style import STYLE as STYLE
from jbeamshell.plotting.style import close as close
from jbeamshell.plotting.style import colours as colours
from jbeamshell.plotting.style import in_units as in_units
from jbeamshell.plotting.style import looks as looks
from jbeamshell.plotting.style import mark_decades as mark_decades
from jbeamshell.plotting.style import panels as panels
from jbeamshell.plotting.style import save as save
from jbeamshell.plotting.style import style as style
from jbeamshell.plotting.style import thumbnail as thumbnail
from jbeamshell.plotting.sweeps import master_curve as master_curve
from jbeamshell.plotting.sweeps import sweep as sweep
from jbeamshell.plotting.sweeps import sweep_contour as sweep_contour
from jbeamshell.plotting.sweeps import sweep_sheet as sweep_sheet
