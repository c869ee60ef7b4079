"""The non-smooth verifier: independent methods, their convergence and the verdict (NumPy and numba, no JAX).

The public function `camopt.verify` stands in `camopt.verifier.accuracy`; the verdict it returns in
`camopt.verifier.verdict`.

Every method of `methods` assembles its own equations and has its own contact law: that duplication is the independence.
A test reads the imports; none may import JAX, the smoothed path or event-exact. What all methods share, and how it is
checked, is said in docs/model.md.

A method's step is halved until its metrics converge (`convergence`). The methods' answers at a speed are compared with
each other and with the limits (`at_speed`), at the listed speeds and at the worst ones of the swept band (`verdict`);
`spot_checks` chooses the speeds where not every method judges all. The record of a verification (`record`) is what the
terminal, the report, the designer and the figures read. Exudyn may simulate the motions too (`from_outside`); it
decides nothing, but where it disagrees the verdict is not converged.
"""

DRAFT, STANDARD, FINE = ACCURACY_NAMES = "draft", "standard", "fine"
"""The accuracies, the finest last. They stand here for those who name one and load nothing else for it."""
