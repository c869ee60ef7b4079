"""Many tasks: what a task is, the store of their rows, and the processes or the cluster that compute them.

A task is plain data, a dictionary with a `verb`. Every verb takes `scene` (a built-in name, a TOML file or text, or a
`Scene`), `cam` (as the command line names one, or a `Lift`) and `vary`, numbers of the scene by NAME.KEY that replace
those of the scene:

- "settled" with `speed_rpm`: the metrics of the settled motion by event-exact (no verdict: one method alone confirms
  nothing), the lowest and highest of the measured revolutions, and which limits they break;
- "simulate" with `speed_rpm`, `method`, `revolutions` and `step_deg`: the worst metrics of a motion from rest, and the
  largest position of the valve;
- "yield" with `speeds_rpm`, `train` and `seed`: how much of each limit one drawn train uses, as in `camopt yield`;
- "rehearse" with `number`, `seconds` and `end`: a stand-in without any scene, to rehearse a sweep. It waits, returns a
  fraction that follows from its number, and with `end` "raise" or "die" it fails or kills its process.
- "call" with `function`, "package.module:name", and `arguments` by name: a function of one's own, which every worker
  can import and which returns a dictionary of plain data. Only programs may ask for it, no plan.

`camopt.sweep(tasks, "x.sqlite")` computes them and keeps a row for each of them.
"""
