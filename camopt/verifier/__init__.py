"""The non-smooth verifier: independent methods, their convergence and the verdict (NumPy and numba, no JAX).

The public function `camopt.verify` is defined in `camopt.verifier.accuracy`, its verdict in `camopt.verifier.verdict`.

Every method of `methods` assembles its own equations and has its own contact law: this duplication makes the methods
independent. No method may import JAX, the smoothed path or event-exact, and a test checks the imports. docs/model.md
states what all methods share and how that is checked.

A method's step is halved until its metrics converge (`convergence`). The methods' answers at a speed are compared with
each other and with the limits (`at_speed`), at the listed speeds and at the worst ones of the swept band (`verdict`);
`spot_checks` chooses the speeds for all methods where most speeds are judged by event-exact alone. The terminal, the
report, the designer and the figures read the record of a verification (`record`). Exudyn can simulate the motions too
(`from_outside`): it cannot confirm or reject a cam, but where it disagrees the verdict is not converged.
"""

DRAFT, STANDARD, FINE = ACCURACY_NAMES = "draft", "standard", "fine"
"""Names of the accuracies, the finest last; defined here so that they can be imported without loading the methods."""
