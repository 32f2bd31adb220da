"""Any homogeneous straight strip by real finite elements: CalculiX behind one call.

    from calibration.finite_elements import solve

    history = solve(jbeamshell.Scene())

gives the `jbeamshell.History` that `jbeamshell.solve` gives, of plane elements on a rigid base with
Coulomb's friction, so that figures, pictures and comparisons work alike.  On the command line:

    python -m calibration.finite_elements --set strip.height_ratio=0.2

The standard strips dissipate what the data in calibration/data say to half a per cent, in about
half a minute a cycle (check.json, by `python -m calibration check`).

The force enters as ``load.entry`` says.  A member that goes on is meshed as far beyond the contact
as plane elasticity continues it, and u leaves out that length's even stretch as there.

What is the reduced model's own is ignored: everything under ``model`` but the kinematics (exact
ones make the elements geometrically nonlinear), and kappa_s, alpha, m and the friction law, for
here friction is Coulomb's with a stiff penalty.  The contact is always unilateral.

Where little slips, A below about 3 mu F_N H, the default mesh hardly sees the slip at the corner,
and D comes out too large (by 7 % at 2.5 mu F_N H, eta .4): raise ``refinement`` and compare.

A pinned far end is held at one point, the corner of the base, where elasticity's stresses are
singular; D hardly minds, a mesh study would.  Tractions are those on the points of the base: a
strip that slides by more than a small part of an element should not be read point by point.
"""

from calibration.finite_elements.solving import solve

__all__ = ["solve"]
