"""`camopt.identify`: parameters of a train from its measured valve lift.

The fit follows the motion from its beginning on, and from several starts (`camopt.study.identify.lift_fit`); the
residual is held against the sensor's noise. The intervals are those of the linear model at the estimate (Seber and
Wild, Nonlinear Regression, 1989), in the logarithms, with Student's t and the noise of the residual, taken as white.
Positions fix forces only up to a common factor: leave one preload or stiffness at a known value.
"""
