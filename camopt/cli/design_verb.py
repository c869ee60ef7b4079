"""The verb `design` of the command line: the live designer, until it is interrupted."""

import gc
import signal
import sys
from argparse import Namespace
from pathlib import Path

from camopt.scene import load_scene


def design(args: Namespace) -> int:
    """Serves the designer's page on this machine and prints its address; an interrupt is its ordinary end."""
    scene = load_scene(args.scene, need=("valve", "seat", "operation", "design"))
    from camopt.designer.desk import Desk
    from camopt.designer.server import DesignServer
    from camopt.designer.session import QUICK, Session
    from camopt.optimizer.first_run import SAYING, compile_programs, programs_missing

    desk = Desk(Session(scene), Path.cwd())
    server = DesignServer(desk, args.port)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        if programs_missing():
            print(SAYING, file=sys.stderr, flush=True)
            compile_programs()
        desk.slow.start()
        for part in QUICK:  # loads the programs, so that the page's first answers are as quick as all others
            desk.session.answer({}, part)
        gc.freeze()  # else an answer now and then waits for a walk through all that was loaded
        print(f"{scene.name}: open {server.address} in a browser on this machine; Ctrl-C ends it", flush=True)
        server.serve_forever()
    except KeyboardInterrupt:
        print("the designer has ended", file=sys.stderr)
    finally:
        server.server_close()
        desk.stop()
    return 0
