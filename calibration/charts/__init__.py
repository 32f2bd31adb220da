"""Charts of the recorded benchmarks and studies."""

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
