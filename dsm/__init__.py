"""Dynamic-stiffness model (DSM) of a spindle: modes, tip response and bearing calibration.

Beams on springs, Euler-Bernoulli or Timoshenko, exact at every frequency. Source: O. Gaber and S. M. Hashemi,
Effects of Machine Tool Spindle Decay on the Stability Lobe Diagram, Shock and Vibration, 2015, without its poles.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
