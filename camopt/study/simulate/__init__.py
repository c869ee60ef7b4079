"""`camopt.simulate`: one motion from rest by any method, with a given step or a given accuracy.

The dataset has a notebook display and plots itself: `motion.position_mm.sel(mass=scene.valve).plot(x="time_s")`.

Steps. `step_deg` is the step of the result. The method's own step is this step divided by the smallest integer for
which step * highest rate of the train <= 0.3; "smooth" refines its grid itself. Between a method's samples positions
are cubic, velocities their derivative, and forces linear; where a force jumps, its later value is returned.

Metrics. With `parameters` and "event" the dataset holds all declared metrics except the excess lift, which has no exact
gradient. A train without a contact between cam and valve has no metrics.

Gradients. With `parameters` the speed may be traced, too, by `jax.grad`, `jax.jit` and `jax.vmap`; it is assumed to be
at least the lowest speed of the scene. The dataset then holds JAX arrays (`.data`); a motion that the method cannot
compute is NaN throughout. By "event" the gradients are those of the exact motion; for metrics of many motions,
`camopt.smooth.exact_rule.exact_metrics` is cheaper. docs/explanation/gradients.md has an example.
"""
