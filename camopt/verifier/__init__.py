"""The non-smooth verifier: independent methods, their convergence and the verdict (NumPy and numba, no JAX).

The public function `camopt.verify` stands in `camopt.verifier.accuracy`; the verdict it returns in
`camopt.verifier.verdict`.

How verification works
======================

- Every method of `methods` assembles its own equations and has its own contact law: that duplication is the
  independence. Before the motion they share only the train's data, the state at rest, the lift law and the response
  record. A test reads the imports; none may reach for JAX, the smoothed path or event-exact. What follows is shared by
  all methods, and settling and metrics are shared with the search's judge too: docs/model.md says what guards them.
- At each speed a method starts at rest and runs until the state one revolution apart moves less than 1 um and 1 mm/s,
  at most 40 revolutions (`camopt.measure.settling`); the next four are measured, and a metric is its worst over them
  (`camopt.measure.metrics`). A motion that does not settle is reported as aperiodic, with its range.
- A method's step is halved until bounce and jump stand (`convergence`); what the last halvings moved is the error
  estimate of every figure.
- Agreement: the deciding figures of all methods overlap within range and error estimate. Then every limit of the scene
  is held against the upper end, over neighbouring states, speeds (0.1 %) and lifts (0.1 um), at the listed speeds and
  at the worst speeds of the swept band (`verdict`). Limits on the shape are judged exactly, from the roots of the
  pieces (`camopt.measure.limits`).
- A judge from outside may be asked too (`from_outside`): Exudyn, in a process that imports nothing of camopt but
  `camopt.verifier.outside`. It decides nothing; where it disagrees the verdict is not converged.
- *confirmed*: they agree and every limit holds. *rejected*: they agree and a limit is broken, named in `broken`.
  *sensitive*: the neighbourhood straddles a limit. *not converged*: no agreement; one method alone never confirms.
"""
