"""The non-smooth verifier: independent methods, their convergence and the verdict (NumPy and numba, no JAX).

The public function `camopt.verify` stands in `camopt.verifier.accuracy`; the verdict it returns in
`camopt.verifier.verdict`.

How verification works
======================

- Every method of `methods` assembles its own equations and has its own contact law: that duplication is the
  independence. Before the motion they share only the train's data, the state at rest, the lift law and the response
  record. A test reads the imports; none may import JAX, the smoothed path or event-exact. What follows is shared by
  all methods, and settling and metrics are shared with the search too: docs/model.md says how they are checked.
- At each speed a method starts at rest and runs until the state one revolution apart moves less than 1 um and 1 mm/s,
  at most 40 revolutions (`camopt.measure.settling`); the next four are measured, and a metric is its worst over them
  (`camopt.measure.metrics`). A motion that does not settle is reported as aperiodic, with its range.
- A method's step is halved until its metrics converge (`convergence`); what the last halvings changed gives the error
  estimate of every metric.
- Agreement: the deciding metrics of all methods overlap within range and error estimate. Then every limit of the scene
  is compared with the worst-case value, over neighbouring states, speeds (0.1 %) and lifts (0.1 um), at each listed
  speed (`at_speed`) and at the worst speeds of the swept band (`verdict`). Where not every method judges every speed,
  `spot_checks` chooses the speeds. Limits on the shape are judged exactly, from the roots of the pieces
  (`camopt.measure.limits`).
- The record of a verification (`record`) is what the terminal, the report, the designer and the figures read.
- Exudyn may simulate the motions too (`from_outside`), in a process that imports nothing of camopt but
  `camopt.verifier.outside`. It decides nothing; where it disagrees the verdict is not converged.
- *confirmed*: they agree and every limit holds. *rejected*: they agree and a limit is broken, named in `broken`.
  *sensitive*: the neighbourhood straddles a limit. *not converged*: no agreement; one method alone never confirms.
"""
