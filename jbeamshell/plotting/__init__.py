"""Pictures of a history (its loop, profiles along X, contact), fits, sweeps and benchmarks.

The only package that imports matplotlib.  Every function draws into the axes it is given or into
new ones, returns them, and neither shows them nor changes matplotlib's settings.  `style` dresses
figures of your own alike.
"""

from calibration.charts.discretisations import methods_contacts as methods_contacts
from calibration.charts.discretisations import methods_grids as methods_grids
from calibration.charts.discretisations import methods_locking as methods_locking
from calibration.charts.discretisations import methods_oscillation as methods_oscillation
from calibration.charts.discretisations import methods_shooting as methods_shooting
from calibration.charts.failures import OUTCOMES as OUTCOMES
from calibration.charts.failures import failure_map as failure_map
from calibration.charts.failures import failure_scatter as failure_scatter
from calibration.charts.failures import failure_sheets as failure_sheets
from calibration.charts.failures import outcome as outcome
from calibration.charts.ladder import RUNG_LOOKS as RUNG_LOOKS
from calibration.charts.ladder import advice_map as advice_map
from calibration.charts.ladder import error_map as error_map
from calibration.charts.ladder import work_precision as work_precision
from calibration.charts.methods import methods_controls as methods_controls
from calibration.charts.methods import methods_laws as methods_laws
from calibration.charts.methods import methods_sheet as methods_sheet
from calibration.charts.methods import methods_solvers as methods_solvers
from calibration.charts.methods import methods_steps as methods_steps
from calibration.charts.speed import speed_batches as speed_batches
from calibration.charts.speed import speed_derivative as speed_derivative
from calibration.charts.speed import speed_errors as speed_errors
from calibration.charts.speed import speed_gradients as speed_gradients
from calibration.charts.speed import speed_nodes as speed_nodes
from calibration.charts.speed import speed_processes as speed_processes
from calibration.charts.speed import speed_sheet as speed_sheet
from jbeamshell.plotting.contacts import contact as contact
from jbeamshell.plotting.contacts import contact_map as contact_map
from jbeamshell.plotting.fits import likelihoods as likelihoods
from jbeamshell.plotting.fits import overlay as overlay
from jbeamshell.plotting.fits import residuals as residuals
from jbeamshell.plotting.motions import energies as energies
from jbeamshell.plotting.motions import modal_curve as modal_curve
from jbeamshell.plotting.motions import ring_down as ring_down
from jbeamshell.plotting.motions import ring_down_sheet as ring_down_sheet
from jbeamshell.plotting.motions import spectrogram as spectrogram
from jbeamshell.plotting.motions import vibration as vibration
from jbeamshell.plotting.paths import loop as loop
from jbeamshell.plotting.paths import profiles as profiles
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
from jbeamshell.plotting.style import save as save
from jbeamshell.plotting.style import style as style
from jbeamshell.plotting.sweeps import master_curve as master_curve
from jbeamshell.plotting.sweeps import sweep as sweep
from jbeamshell.plotting.sweeps import sweep_sheet as sweep_sheet
