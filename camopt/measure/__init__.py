"""What every judge shares: settling, metrics, limits and sweeps over speed, on any method's recorded motion (NumPy).

The search's judge and the verifier's verdict both read motions through these files, so an error of a metric would be
common to them; `tests/measure` therefore reads every metric a second time, from a raw motion and with its own formulas.
The methods that make the motions share nothing with each other (`camopt.verifier.methods`).
"""
