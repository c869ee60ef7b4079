"""`camopt.simulate`: one motion from rest by any method, at a step or at an accuracy.

The dataset shows itself in a notebook, and draws itself:
`motion.position_mm.sel(mass=scene.valve).plot(x="time_s")`.

Steps. `step_deg` is the step of the result. The method's own step is that over the smallest integer for which step *
highest rate of the train <= 0.3; "smooth" refines its grid itself. Between a method's samples positions are cubic,
velocities their derivative, forces linear, and where a force jumps the later value stands.

Metrics. With `parameters` and "event" the dataset holds all declared metrics but the excess lift, of which there is no
exact gradient. A train without a contact between cam and valve has none.

Gradients. Under `parameters` the speed may be traced too, by `jax.grad`, `jax.jit` and `jax.vmap`; it is taken to be
one of the scene's, or above. The dataset then holds JAX arrays (`.data`); a motion that the method cannot follow is NaN
throughout. By "event" the gradients are those of the exact motion, and for many motions metrics alone are cheaper by
`camopt.smooth.exact_rule.exact_metrics`. docs/explanation/gradients.md has an example.
"""
