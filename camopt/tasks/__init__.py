"""Many tasks: their definition, the store of their rows, and the processes or the cluster that compute them.

A task is plain data, a dictionary with a `verb`. Every verb takes `scene` (a built-in name, a TOML file or text, or a
`Scene`), `cam` (as the command line names one, or a `Lift`) and `vary`, values by NAME.KEY that replace those of the
scene:

- "settled" with `speed_rpm`: the metrics of the settled motion by event-exact (without a verdict, because one method
  alone confirms nothing), lowest and highest over the measured revolutions, and the limits that they break;
- "simulate" with `speed_rpm`, `method`, `revolutions` and `step_deg`: the worst metrics of a motion from rest, and the
  largest valve position;
- "yield" with `speeds_rpm`, `train` and `seed`: how much of each limit one drawn train uses, as in `camopt yield`;
- "rehearse" with `number`, `seconds` and `end`: a dummy task without a scene, to rehearse a sweep. It waits and returns
  a fraction derived from its number; with `end` "raise" or "die" it fails or kills its process.
- "call" with `function`, "package.module:name", and `arguments` by name: a user's function, which every worker can
  import and which returns a dictionary of plain data. Only a program may use this verb, not a plan.

`camopt.sweep(tasks, "x.sqlite")` computes them and keeps a row for each of them.
"""
