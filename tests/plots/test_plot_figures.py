import numpy as np
import pytest

from camopt.cam.lift import Lift, lift_table
from camopt.plots import (
    DrawnMotion,
    Sweep,
    bounce_against_speed,
    cam_line,
    convergence,
    last_revolution,
    modes,
    profiles,
    valve_motion,
)
from camopt.plots.speeds import first_exceeded
from camopt.plots.yields import SHOWN, blame_bars, used_against_speed
from camopt.scene.load import load_scene
from camopt.scene.response import Response
from camopt.scene.train import build_train
from camopt.scene.units import DEG, MM
from experiments.modes import campbell
from experiments.support.panels import Panel, panels

SCENE = load_scene("kodama")
DESIGN = SCENE.design
SPEEDS = np.array([5000.0, 6000.0, 7000.0])


def bump(height_mm: float, half_deg: float = 72.0) -> dict:
    """Table of lift = height (1 - (angle / half)^2)^4 [mm]: smooth, with known extremes."""
    half = half_deg * DEG
    inside = np.zeros(9)
    for k, c in enumerate((1, -4, 6, -4, 1)):
        inside[2 * k] = height_mm * MM * c / half ** (2 * k)
    shifted = np.polynomial.Polynomial(inside)(np.polynomial.Polynomial([-half, 1.0])).coef
    coefficients = np.array([np.zeros(9), shifted, np.zeros(9)])
    return lift_table(Lift(np.array([-np.pi, -half, half, np.pi]), coefficients, half), 0.5)


def lines_of(axes, cam: str):
    return [line for line in axes.lines if line.get_color() == cam_line(cam)["color"]]


def levels(axes) -> set[float]:
    """Heights of the horizontal lines across the whole axes."""
    return {line.get_ydata()[0] for line in axes.lines if list(line.get_xdata()) == [0, 1]}


def test_profiles_draw_the_tables_and_the_limits():
    tables = {"design": bump(9.0), "polydyne": bump(8.0)}
    rows = profiles(list(tables.items()), DESIGN).axes
    columns = ("lift_mm", "velocity_mm_per_deg", "acceleration_mm_per_deg2", "jerk_mm_per_deg3")
    for axes, column, unit in zip(rows, columns, ("mm", "mm/deg", "mm/deg²", "mm/deg³"), strict=True):
        for name, table in tables.items():
            (line,) = lines_of(axes, name)
            np.testing.assert_array_equal(line.get_ydata(), table[column])
            np.testing.assert_array_equal(line.get_xdata(), table["cam_angle_deg"])
        assert f"[{unit}]" in axes.get_ylabel()
    assert levels(rows[0]) == {9.4} and levels(rows[2]) == {0.015, -0.008} and levels(rows[3]) == {0.003, -0.003}
    assert "[deg]" in rows[3].get_xlabel()
    low, high = rows[3].get_xlim()
    assert low < -72 - 0.265 / 0.011 < 72 + 0.265 / 0.011 < high < 180


def test_profiles_without_limits_draw_none():
    keys = ("acceleration_max_mm_per_deg2", "acceleration_min_mm_per_deg2", "jerk_max_mm_per_deg3", "nose_deg")
    free = DESIGN.model_copy(update=dict.fromkeys(keys))
    rows = profiles([("design", bump(9.0))], free).axes
    assert [len(levels(axes)) for axes in rows] == [1, 0, 0, 0]


def test_profiles_name_the_jerk_that_exceeds_the_axis():
    steep = bump(9.0, half_deg=30.0)
    largest = np.max(np.abs(steep["jerk_mm_per_deg3"]))
    assert largest > 2.5 * 0.003
    axes = profiles([("design", bump(4.0)), ("multi-pol", steep)], DESIGN).axes[3]
    assert axes.get_ylim() == (-0.0075, 0.0075)
    title = axes.get_title("left")
    assert title == f"beyond this axis [±mm/deg³]: multi-pol {largest:.3g}"


def motion(cam: str, speed: float, rebound: float, last_deg: float) -> DrawnMotion:
    """Half-sine valve lift with a touch at 70 deg and one rebound of `rebound` mm that ends at `last_deg`."""
    angle = np.linspace(-180, 180, 3601)
    lift = np.where(np.abs(angle) < 70, 9 * np.cos(angle / 70 * np.pi / 2), 0.0)
    up = (angle > 75) & (angle < last_deg)
    lift = np.where(up, rebound * np.sin((angle - 75) / (last_deg - 75) * np.pi), lift)
    force = np.where(np.abs(angle) < 70, 500.0 + speed, 0.0)
    return DrawnMotion(cam, speed, angle, lift, {"cam_follower": force, "follower_valve": 0.5 * force})


def test_valve_motion_has_a_column_per_speed_and_a_row_per_contact():
    motions = [motion(c, s, r, 110) for s in (7000.0, 5000.0) for c, r in (("design", 0.02), ("polydyne", 0.3))]
    figure = valve_motion(motions, DESIGN)
    grid = np.array(figure.axes).reshape(4, 2)
    assert [axes.get_title("left") for axes in grid[0]] == ["5000 r/min", "7000 r/min"]
    assert "[mm]" in grid[0, 0].get_ylabel() and "[mm]" in grid[1, 0].get_ylabel() and "[N]" in grid[2, 0].get_ylabel()
    for column, speed in enumerate((5000.0, 7000.0)):
        for cam in ("design", "polydyne"):
            m = next(m for m in motions if (m.cam, m.speed_rpm) == (cam, speed))
            np.testing.assert_array_equal(lines_of(grid[0, column], cam)[0].get_ydata(), m.valve_mm)
            for row, contact in enumerate(m.contact_force_N, 2):
                drawn = lines_of(grid[row, column], cam)[0].get_ydata()
                np.testing.assert_array_equal(drawn, m.contact_force_N[contact])


def test_zoom_shows_the_whole_bounce_and_the_limit():
    axes = valve_motion([motion("design", 7000, 0.3, 130)], DESIGN).axes[1]
    (left, right), (low, top) = axes.get_xlim(), axes.get_ylim()
    assert 66 < left < 70 and 130 < right < 140  # the touch at 70 deg lies before the duration's end at 72
    assert 0.3 < top < 0.5 and low < 0
    assert 0.05 in levels(axes)
    quiet = valve_motion([motion("design", 7000, 0.0, 130)], DESIGN).axes[1]
    assert quiet.get_ylim()[1] == pytest.approx(0.15)  # three times the limit, which must be seen


def test_spikes_of_another_cam_do_not_flatten_the_design():
    wild = motion("polydyne", 7000, 1.9, 140)
    wild.contact_force_N["cam_follower"][1800] = 4e4
    figure = valve_motion([motion("design", 7000, 0.02, 110), wild], DESIGN)
    zoom, force = figure.axes[1], figure.axes[2]
    assert zoom.get_ylim()[1] < 0.2 and force.get_ylim()[1] < 1.5 * 7500  # the design's largest force is 7500 N
    assert zoom.get_title("left") == "beyond this axis [mm]: polydyne 1.9"
    assert force.get_title("left") == "beyond this axis [N]: polydyne 4e+04"
    assert "design" not in force.get_title("left")


def test_a_force_limit_far_above_the_forces_is_not_drawn():
    far = DESIGN.model_copy(update={"contact_force_max_N": 30_000.0})
    near = DESIGN.model_copy(update={"contact_force_max_N": 9_000.0})
    one = [motion("design", 7000, 0.02, 110)]
    assert 30_000.0 not in levels(valve_motion(one, far).axes[2])
    axes = valve_motion(one, near).axes[2]
    assert 9_000.0 in levels(axes) and axes.get_ylim()[1] > 9_000.0


def test_marks_of_the_verdict_stand_where_the_verdict_says():
    speed = np.arange(5000.0, 7300.0, 100.0)
    jump = np.where(speed == 6900, 0.13, 0.01)
    starts, worst = {"bounce_mm": None, "jump_mm": 6870.0}, {"jump_mm": (6900.0, 0.13), "bounce_mm": (5000.0, 0.0)}
    sweep = Sweep("design", speed, 0 * speed, jump, starts_rpm=starts, worst=worst)
    top, bottom = bounce_against_speed([sweep], DESIGN, (5000, 7000)).axes
    marks = {
        line.get_marker(): (line.get_xdata()[0], line.get_ydata()[0])
        for line in bottom.lines
        if line.get_marker() in ("D", "o")
    }
    assert marks == {"D": (6870.0, 0.05), "o": (6900.0, 0.13)}
    assert {text.get_text() for text in bottom.texts} >= {"6870", "0.13"}
    assert not [line for line in top.lines if line.get_marker() == "D"]


def steps(stage, area_ratio, **columns) -> list[dict]:
    """Lines of history.jsonl; every step holds the limits unless `columns` states otherwise."""
    columns = {"stage": stage, "area_ratio": area_ratio} | columns
    lines = zip(*columns.values(), strict=True)
    return [{"worst_bounce_mm": 0.01, "confirmed": True} | dict(zip(columns, line, strict=True)) for line in lines]


def test_convergence_shows_the_best_of_the_search_and_the_delivered_cam():
    best = np.array([0.55, 0.60, 0.57])
    history = steps(["margins"] * 3, [0.55, 0.60, 0.57], best_area_ratio=best)
    axes = convergence(history, 0.62, 0.55, 0.05, (0.57, "confirmed")).axes[0]
    lines = {line.get_label(): line for line in axes.lines}
    np.testing.assert_array_equal(lines["best of the search"].get_ydata(), best)  # it may fall
    assert list(lines["delivered, confirmed: 0.5700"].get_ydata()) == [0.57]


def test_last_revolution_of_a_response():
    train = build_train(SCENE)
    angle = np.linspace(-np.pi, 3 * np.pi, 721)
    x = np.zeros((721, len(train.mass)))
    x[:, train.valve] = 2e-3 + 1e-3 * (angle > np.pi)
    force = np.outer(np.arange(721.0), np.arange(len(train.a)))
    response = Response(train, 300.0, angle, np.zeros(721), x, np.zeros_like(x), force)
    m = last_revolution("design", 6000, response)
    assert m.cam_angle_deg[0] == pytest.approx(-180) and m.cam_angle_deg[-1] == pytest.approx(180)
    assert m.cam_angle_deg[180] == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(m.valve_mm, response.seat_separation()[360:] * 1e3)
    assert list(m.contact_force_N) == [train.element_names[e] for e in train.cam_side]
    np.testing.assert_array_equal(m.contact_force_N[train.element_names[train.cam_side[0]]],
                                  force[360:, train.cam_side[0]])  # fmt: skip


def test_bounce_against_speed_draws_values_limits_and_the_speeds_without_touch():
    speed = np.arange(5000.0, 7600.0, 100.0)
    bounce = (speed - 5000) / 1e4
    lost = np.where(speed > 7000, np.nan, bounce)
    sweeps = [Sweep("design", speed, bounce, 2 * bounce), Sweep("kurz", speed, lost, bounce)]
    figure = bounce_against_speed(sweeps, DESIGN, (5000, 7000), (5000, 6000))
    top, bottom = figure.axes
    np.testing.assert_array_equal(lines_of(top, "design")[0].get_ydata(), bounce)
    np.testing.assert_array_equal(lines_of(bottom, "design")[0].get_ydata(), 2 * bounce)
    marks = [line for line in top.lines if line.get_marker() == "x"]
    np.testing.assert_array_equal(marks[0].get_xdata(), speed[speed > 7000])
    assert "never seats" in marks[0].get_label()
    assert [list(line.get_xdata()) for line in top.lines if line.get_marker() == "^"] == [[5000, 6000]]
    for axes in (top, bottom):
        assert 0.05 in levels(axes) and "[mm]" in axes.get_ylabel()
        assert axes.get_ylim()[0] == 0 and axes.get_ylim()[1] > 0.25
    assert "[r/min]" in bottom.get_xlabel()


def test_bounce_axis_is_not_lost_when_nothing_bounces():
    speed = np.array([5000.0, 7000.0])
    figure = bounce_against_speed([Sweep("design", speed, 0 * speed, 0 * speed)], DESIGN, (5000, 7000))
    assert figure.axes[0].get_ylim()[1] > 0.05
    loose = DESIGN.model_copy(update={"bounce_max_mm": 0.5})
    figure = bounce_against_speed([Sweep("design", speed, 0 * speed, 0 * speed)], loose, (5000, 7000))
    assert figure.axes[0].get_ylim()[1] > 0.5


def test_convergence_draws_steps_limits_and_stages():
    area, confirmed = [0.50, 0.60, 0.52, 0.51, 0.55], [True, False, True, True, True]
    stage = ["program", "program", "margins", "margins", "margins"]
    best = np.array([0.50, 0.50, 0.52, 0.52, 0.55])
    columns = {"worst_bounce_mm": [None, 0.3, 0.04, 0.03, 0.05], "confirmed": confirmed, "best_area_ratio": best}
    top, bottom = convergence(steps(stage, area, **columns), 0.62, 0.57, 0.05).axes
    drawn = next(line for line in top.lines if line.get_label() == "best of the search")
    np.testing.assert_array_equal(drawn.get_ydata(), best)
    assert levels(top) == {0.62, 0.57} and levels(bottom) == {0.05}
    words = [text.get_text() for text in top.texts]
    assert "program" in words and "margins" in words and any("bound" in w and "0.6200" in w for w in words)
    hollow = next(line for line in top.lines if line.get_markerfacecolor() == "white")
    assert list(hollow.get_ydata()) == [0.60]


def test_convergence_of_a_search_for_a_yield_shows_failing_trains():
    columns = {"worst_bounce_mm": [None, None], "confirmed": [False, True], "failing": [4, 1], "trains": [200, 200]}
    history = steps(["common margin"] * 2, [0.56, 0.55], **columns)
    lower = convergence(history, bounce_max_mm=0.05).axes[1]
    assert lower.get_ylabel() == "failing trains [%]" and not levels(lower) and lower.get_ylim()[0] == 0.0
    np.testing.assert_array_equal(lower.lines[0].get_ydata(), [2.0, 0.5])


def test_convergence_of_an_unconfirmed_search_has_no_best():
    history = steps(["program"], [0.5], worst_bounce_mm=[None], confirmed=[False])
    assert not [line for line in convergence(history).axes[0].lines if line.get_label() == "best of the search"]


def test_modes_show_every_shape_with_its_frequency():
    shape = np.array([[0.6, 0.8], [0.8, -0.6], [-1.0, 0.0]])
    figure = modes([352.4, 1234.5, 18430.0], shape, ["valve", "coil"], "lifted")
    drawn = [next(line for line in axes.lines if line.get_marker() == "o").get_xdata() for axes in figure.axes[:3]]
    np.testing.assert_allclose(drawn, [[0.6, 0.8], [0.8, -0.6], [1.0, 0.0]])
    titles = [axes.get_title("left") for axes in figure.axes[:3]]
    assert titles == ["1:  352.4 Hz", "2:  1.234 kHz", "3:  18.43 kHz"]
    assert "lifted" in figure.get_suptitle()


def test_modes_refuse_shapes_that_do_not_fit():
    with pytest.raises(ValueError, match="2 modes by 1 masses"):
        modes([1.0, 2.0], np.eye(3), ["valve"])


def test_modes_state_how_many_are_left_out():
    names = [f"m{i}" for i in range(20)]
    assert "5 highest left out" in modes(np.arange(1.0, 21.0), np.eye(20), names).get_suptitle()


def test_campbell_dots_lie_where_a_ray_meets_a_frequency_inside_the_band():
    axes = campbell([350.0], [6, 7], (5000, 7000), 0.5).axes[0]
    dots = [(float(line.get_xdata()[0]), float(line.get_ydata()[0])) for line in axes.lines if line.get_marker() == "o"]
    # 350 Hz is order 7 at 6000 r/min and order 6 at 7000 r/min (cam at half speed)
    assert sorted(dots) == [(6000.0, 350.0), (7000.0, 350.0)]


def test_panels_keep_a_label_in_one_colour_and_cams_in_their_own():
    x = np.array([0.0, 1.0])
    rows = [[Panel("a", [("polydyne", x, x), ("rkg", x, 2 * x)])], [Panel("b", [("rkg", x, x), ("tmm", x, x)])]]
    first, second = panels(rows, "x").axes
    colour = {
        line.get_label(): line.get_color() for line in first.lines if not str(line.get_label()).startswith("_")
    }  # the legend's lines
    assert colour["polydyne"] == cam_line("polydyne")["color"]
    assert len(set(colour.values())) == 3
    assert [line.get_color() for line in second.lines[:2]] == [colour["rkg"], colour["tmm"]]
    assert list(first.lines[1].get_ydata()) == [0.0, 2.0]


def test_a_cam_is_marked_where_it_first_passes_the_limit():
    speed = np.array([5000.0, 5100.0, 5200.0, 5300.0])
    assert first_exceeded(speed, np.array([0.0, 0.04, 0.08, 0.0]), 0.05) == pytest.approx(5125.0)
    assert first_exceeded(speed, np.array([0.0, 0.05, 0.05, 0.0]), 0.05) is None  # on the limit is within
    assert first_exceeded(speed, np.array([0.0, 0.0, np.nan, 0.0]), 0.05) == 5200.0  # never seats
    assert first_exceeded(speed, np.array([0.1, 0.0, 0.0, 0.0]), 0.05) == 5000.0
    axes = bounce_against_speed([Sweep("kurz", speed, 0.04 * np.arange(4), 0 * speed)], DESIGN, (5000, 5300)).axes
    marks = [[line for line in a.lines if line.get_marker() == "D"] for a in axes]
    assert [len(m) for m in marks] == [1, 0]
    assert marks[0][0].get_xdata()[0] == pytest.approx(5125.0) and marks[0][0].get_ydata()[0] == 0.05
    assert marks[0][0].get_color() == cam_line("kurz")["color"]
    assert "≈5120" in [t.get_text() for t in axes[0].texts]


def test_names_of_short_stages_do_not_overlap():
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    stage = ["no-jump program", "re-located angles", *["margin"] * 5, *["margins by gradient"] * 4, *["gradient"] * 6]
    figure = convergence(steps(stage, [0.56] * len(stage)), 0.62, 0.56, 0.05)
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    boxes = [t.get_window_extent(renderer) for t in figure.axes[0].texts if t.get_text() in stage]
    assert len(boxes) == 5
    for i, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[:i])


def test_numbers_of_neighbouring_marks_stand_on_different_sides():
    speed = np.arange(5000.0, 7001.0, 50.0)
    cams = (("new-design", 5300.0), ("multi-pol", 5350.0), ("polydyne", 6500.0))
    sweeps = [Sweep(cam, speed, np.where(speed > at, 0.1, 0.0), np.zeros(len(speed))) for cam, at in cams]
    axes = bounce_against_speed(sweeps, DESIGN, (5000.0, 7000.0)).axes[0]
    sides = {text.get_text(): text.get_ha() for text in axes.texts if text.get_text().startswith("≈")}
    assert list(sides.values()) == ["right", "left", "right"]


def test_names_of_late_stages_end_inside_the_figure():
    stage = [*["no-jump program"] * 2, *["margin"] * 102, *["margins by gradient"] * 4, *["gradient"] * 6]
    sides = {text.get_text(): text.get_ha() for text in convergence(steps(stage, [0.56] * 114)).axes[0].texts}
    assert [sides[name] for name in dict.fromkeys(stage)] == ["left", "left", "right", "right"]


def test_median_ranges_and_worst_train_stand_in_a_panel_for_each_limit():
    used = np.linspace(0.0, 1.0, 21)[:, None] * np.array([0.5, 1.0, 1.5])
    used[-1, 2] = np.inf
    figure = used_against_speed(
        np.array([5000.0, 6000.0, 7000.0]), {"bounce_max_mm": used, "jump_max_mm": 0.5 * used[:-1]}, "kodama"
    )
    bounce, jump = figure.axes
    median, worst = bounce.lines[:2]
    np.testing.assert_allclose(median.get_ydata(), [0.25, 0.5, 0.75])
    assert worst.get_ydata()[:2] == pytest.approx([0.5, 1.0]) and worst.get_ydata()[2] > SHOWN == bounce.get_ylim()[1]
    assert bounce.get_title(loc="left") == "kodama\nbounce_max_mm" and "r/min" in jump.get_xlabel()
    assert [text.get_text() for text in figure.legends[0].get_texts()][-2:] == ["median", "worst train"]


def test_bars_of_scatter_and_of_halved_tolerances():
    figure = blame_bars({"lash": 0.4, "preload": 0.1}, {"lash": 0.05, "preload": -0.01})
    blame, bought = figure.axes
    assert [bar.get_width() for bar in blame.patches] == pytest.approx([10.0, 40.0])
    assert [bar.get_width() for bar in bought.patches] == pytest.approx([-1.0, 5.0])
    assert [label.get_text() for label in blame.get_yticklabels()] == ["preload", "lash"]
    assert len(blame_bars({"lash": 0.4}, {}).axes) == 1
