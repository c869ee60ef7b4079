"""Options about a cam: how it is named, how a lift table is read, what is written of it, and its card."""

import argparse

from camopt.cli.values import angles, columns, digits, lifts, line_number, picture_file, positive, probe, standing


def cam_options(c: argparse.ArgumentParser, default: str | None = None, required: bool = True) -> None:
    c.add_argument(
        "--cam",
        required=required and default is None,
        default=default,
        metavar="CAM",
        help="family (polydyne, or polydyne:exponents=2/10/18/26/34,speed_rpm=6000), lift table, run folder or its "
        "design.json" + (f" ({default})" if default else ""),
    )
    table_options(c)


def table_options(c: argparse.ArgumentParser) -> None:
    c.add_argument("--table-angle", choices=("cam", "crank"), help="angle of a lift table from elsewhere")
    c.add_argument("--table-lift", choices=("mm", "m", "inch"), help="unit of the lift in such a table")
    c.add_argument(
        "--table-ratio",
        type=positive,
        metavar="R",
        help="valve lift over the table's lift, where that is tappet lift (1); all may also stand in the table's "
        "header, as in '# table-angle = crank'",
    )
    words = (
        "radius of the ball that felt the cam itself, flat for a flat probe: its lift becomes the scene's follower's"
    )
    c.add_argument("--table-probe-mm", type=probe, metavar="R", help=words)
    words = "columns of angle and lift in such a table, by number or name, as in 1,3 (the first two)"
    c.add_argument("--table-columns", type=columns, metavar="ANGLE,LIFT", help=words)
    words = "line in which its rows begin, where the text does not show it"
    c.add_argument("--table-first-line", type=line_number, metavar="N", help=words)


def exchange_options(c: argparse.ArgumentParser) -> None:
    """What `camopt cam` writes."""
    c.add_argument("--step-deg", type=positive, default=0.1, metavar="DEG", help="step of the tables (0.1)")
    words = "lift table by the crank's angle at this step, as in 0.5 or 1"
    c.add_argument("--step-crank-deg", type=positive, metavar="DEG", help=words)
    words = "decimals of the lift in mm (table by cam angle: every digit; by crank angle, and contour: 6)"
    c.add_argument("--digits", type=digits, metavar="N", help=words)
    c.add_argument("--csv", metavar="FILE", help="write the lift table")
    c.add_argument("--contour", metavar="FILE", help="with [geometry]: write the contour, Cartesian and polar")
    c.add_argument("--dxf", metavar="FILE", help="with [geometry]: write the contour as a drawing (extra dxf)")
    words = "largest distance of the drawing's arcs from the contour, in um (0.5)"
    c.add_argument("--dxf-tolerance-um", type=positive, default=0.5, metavar="UM", help=words)
    words = "the valve's lift (the cam's less the lash) each crank degree, as engine simulations read it"
    c.add_argument("--valve-lift", metavar="FILE", help=words)
    c.add_argument("--dynamic-lift", metavar="FILE", help="the same of the valve's own motion at --speed")
    c.add_argument("--figure", type=picture_file, metavar="FILE", help="draw it with the scene's limits, .png or .svg")


def card_options(c: argparse.ArgumentParser) -> None:
    """The cam card of `camopt cam`, its place on the crank, and the camshaft."""
    c.add_argument("--card", action="store_true", help="the cam card: durations and events at stated lifts")
    c.add_argument("--card-csv", metavar="FILE", help="write the cam card as a table")
    c.add_argument("--lifts-mm", type=lifts, metavar="LIST", help="lifts of the card (1,1.27: 1 mm and 0.050 in)")
    words = (
        "how the cam stands on the crank: degrees after top dead centre of the middle of its duration, or opening=DEG, "
        "where its lift passes the first of --lifts-mm, or tdc-lift=MM, its lift at top dead centre on that flank"
    )
    c.add_argument("--centre-deg", type=standing, metavar="DEG", help=words)
    c.add_argument("--exhaust", metavar="CAM", help="another cam on the same scene, for the overlap with this one")
    words = "as --centre-deg, of that cam, as in -110, or closing=DEG, or tdc-lift=MM on its closing flank"
    c.add_argument("--exhaust-centre-deg", type=standing, metavar="DEG", help=words)
    words = "torque of a shaft whose lobes follow the first by cam degrees, as in 0,90,180,270; under way at --speed"
    c.add_argument("--lobes-deg", type=angles, metavar="LIST", help=words)
