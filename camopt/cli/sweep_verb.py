"""The verb `sweep` of the command line."""

import sys
from argparse import Namespace
from contextlib import nullcontext
from pathlib import Path

from camopt.scene import InputError


def sweep(args: Namespace) -> int:
    """Computes the tasks of a plan and says how they ended; 3 where some failed."""
    from camopt.tasks.cluster import cluster
    from camopt.tasks.plan import load_plan

    store = Path(args.store)
    if store.exists() and not args.resume:
        raise InputError(f"{store}: exists already: --resume goes on in it with the same plan; or name another --store")
    if args.resume and not store.exists():
        raise InputError(f"{store}: is not there, so there is nothing to go on with: leave --resume out")
    if args.insecure and args.scheduler is None:
        raise InputError("--insecure: belongs to --scheduler: give both, or leave it out")
    if args.retry_failed and not args.resume:
        raise InputError("--retry-failed: computes the failed tasks of a store once more: add --resume")
    plan = load_plan(args.plan)
    from camopt.tasks.sweep import sweep as sweep_tasks

    with cluster(args.scheduler, args.insecure) if args.scheduler else nullcontext((None, None)) as (executor, threads):
        if not args.quiet:
            print(f"{args.plan}: {len(plan)} tasks into {store}", file=sys.stderr, flush=True)
        args.begun = True
        try:
            found = sweep_tasks(
                plan, store, executor, args.workers or threads, retry_failed=args.retry_failed, progress=not args.quiet
            )
        except InputError:
            args.begun = False  # its sentence says what became of the store
            raise
    if args.csv:
        found.write_csv(args.csv)
    print("\n".join(found.lines()))
    return 3 if "failed" in found.counts else 0
