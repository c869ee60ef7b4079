"""`camopt.identify`: parameters of a train from its measured valve lift.

The fit proceeds from the beginning of the motion and from several starts (`camopt.study.identify.lift_fit`); its
residual is compared with the sensor's noise. The intervals are those of the linear model at the estimate (Seber and
Wild, Nonlinear Regression, 1989), in the logarithms, with Student's t and the noise of the residual, assumed white.
Positions determine forces only up to a common factor: keep one preload or stiffness at a known value.
"""
