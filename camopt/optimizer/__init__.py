"""The largest area a scene's limits allow: linear programs, certified bounds, the search, the baselines, the run.

The public function `camopt.optimize` is defined in `camopt.optimizer.run`.
"""
