"""Exact solutions from the literature, each with its source.

The bar on a frictional foundation and Masing's rule, Cattaneo's and Mindlin's contact, the stuck
strip, a beam of two layers that slip, two bars that lap, Filon's squeezed strip and the psi model
beside it, the bimetal strip, and receding contact.
Units are any consistent set; a strip has unit width, so forces are per width.

Examples
--------
>>> import jbeamshell as jb
>>> jb.reference.cubic_law(0.7855, 3.4e4, 1.0)  # dissipation per cycle of a bar
"""

from jbeamshell.mechanics.bar import bar_backbone as bar_backbone
from jbeamshell.mechanics.bar import bar_force as bar_force
from jbeamshell.mechanics.bar import bar_slip_length as bar_slip_length
from jbeamshell.mechanics.bar import bar_slip_profile as bar_slip_profile
from jbeamshell.mechanics.bar import cubic_law as cubic_law
from jbeamshell.mechanics.bar import lap_backbone as lap_backbone
from jbeamshell.mechanics.bar import lap_cubic_law as lap_cubic_law
from jbeamshell.mechanics.homogeneous import shear_coefficient as shear_coefficient
from jbeamshell.reference.bimetal import bimetal_curvature as bimetal_curvature
from jbeamshell.reference.bimetal import tip_deflection as tip_deflection
from jbeamshell.reference.filon import filon_average as filon_average
from jbeamshell.reference.filon import filon_average_step as filon_average_step
from jbeamshell.reference.filon import filon_midplane as filon_midplane
from jbeamshell.reference.filon import filon_midplane_step as filon_midplane_step
from jbeamshell.reference.layered_beam import layered_beam_deflection as layered_beam_deflection
from jbeamshell.reference.layered_beam import layered_beam_dissipation as layered_beam_dissipation
from jbeamshell.reference.layered_beam import layered_beam_slip_force as layered_beam_slip_force
from jbeamshell.reference.masing import bar_hysteresis as bar_hysteresis
from jbeamshell.reference.masing import masing_dissipation as masing_dissipation
from jbeamshell.reference.masing import masing_loop as masing_loop
from jbeamshell.reference.micro_slip import energy_exponent as energy_exponent
from jbeamshell.reference.micro_slip import height_factor as height_factor
from jbeamshell.reference.micro_slip import slip_energy as slip_energy
from jbeamshell.reference.mindlin import counter_slip_part as counter_slip_part
from jbeamshell.reference.mindlin import goodman_energy as goodman_energy
from jbeamshell.reference.mindlin import mindlin_energy as mindlin_energy
from jbeamshell.reference.mindlin import pair_compliance as pair_compliance
from jbeamshell.reference.mindlin import sphere_law as sphere_law
from jbeamshell.reference.mindlin import stuck_part as stuck_part
from jbeamshell.reference.receding import beam_contact_length as beam_contact_length
from jbeamshell.reference.receding import strip_contact_length as strip_contact_length
from jbeamshell.reference.squeeze import best_decay_ratio as best_decay_ratio
from jbeamshell.reference.squeeze import best_kappa_s as best_kappa_s
from jbeamshell.reference.squeeze import reaction_jump as reaction_jump
from jbeamshell.reference.squeeze import squeeze_decay_length as squeeze_decay_length
from jbeamshell.reference.squeeze import squeeze_step as squeeze_step
from jbeamshell.reference.stuck import first_slip_force as first_slip_force
from jbeamshell.reference.stuck import stuck_decay_rate as stuck_decay_rate
from jbeamshell.reference.stuck import stuck_rotation as stuck_rotation
