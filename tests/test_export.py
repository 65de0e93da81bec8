"""A model elsewhere: the filters, their errors, and the files as other tools read them."""

from __future__ import annotations

import csv
import json
import runpy
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
from scipy.signal import sosfilt

from spa_fo import BadInput, Model, step_response
from spa_fo.cli import main
from spa_fo.export import (
    HOLDS,
    METHODS,
    TARGETS,
    Band,
    Options,
    approximate,
    default_band,
    discretise,
    export_model,
    measure,
    measure_filter,
    oustaloup,
)
from spa_fo.export.accuracy import measure_operator
from spa_fo.export.approximation import Approximation
from spa_fo.export.fitted import exact_response
from spa_fo.export.oustaloup import operator
from spa_fo.plant import Model as Document
from spa_fo.plant import TransferFunction, write_model
from spa_fo.plant.estimates import KEY, bare_estimates, uncertainty_entry

TABLE_I = TransferFunction(1.406, 1.196, 0.794, 1.638, 0.934)
MODELS = {
    "Table I": TABLE_I,
    "near 2": TransferFunction(1.98, 1.0675, 1.7656, 1.7401, 0.9892),
    "a whole order": TransferFunction(1.7257, 1.0, 1.8435, 2.3702, 0.8273),
    "both near 2": TransferFunction(1.9, 1.7, 0.5, 2.0, 1.0),
    "below 1": TransferFunction(0.7, 0.3, 1.0, 1.0, 1.0),
    "hardly damped": TransferFunction(1.9, 0.9, 0.2, 4.0, 2.0),
}
PLAIN = Document("steps", "test rubber", TABLE_I, 30.0)


def exact(g: TransferFunction, t: np.ndarray) -> np.ndarray:
    return step_response(t, g.alpha2, g.alpha1, g.a1, g.a0, g.b0)


# --- Oustaloup's filter -------------------------------------------------------------------------


def test_the_filter_is_that_of_the_paper() -> None:
    zeros, poles, gain = oustaloup(0.5, 0.01, 100.0, 2)
    # w'_k = w_b (w_h/w_b)^((k + N + (1 - a)/2) / (2N + 1)), k = -N .. N, and the gain w_h^a.
    k = np.arange(-2, 3)
    assert -zeros == pytest.approx(0.01 * 1e4 ** ((k + 2 + 0.25) / 5))
    assert -poles == pytest.approx(0.01 * 1e4 ** ((k + 2 + 0.75) / 5))
    assert gain == pytest.approx(10.0)


@pytest.mark.parametrize("order", [0.3, 0.5, 1.25, 1.5, 1.98])
def test_a_longer_filter_is_nearer_to_the_power(order: float) -> None:
    band = Band(0.1, 10.0)
    errors = [
        measure_operator(operator(order, band.low / 1000, band.high * 1000, n), band)
        for n in (2, 4, 9)
    ]
    assert errors[0]["max_deg"] > errors[1]["max_deg"] > errors[2]["max_deg"]
    assert errors[2]["max_db"] < 0.02
    assert errors[2]["max_deg"] < 0.2


def test_a_whole_power_needs_no_filter() -> None:
    one = operator(1.0, 0.01, 100.0, 3)
    assert one.zeros.size == one.poles.size == 0
    assert one.response(np.array([2.0]))[0] == pytest.approx(2j)


# --- the whole of G -----------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", MODELS)
def test_the_approximation_is_stable_exact_at_rest_and_close(name: str, method: str) -> None:
    g = MODELS[name]
    made = approximate(g, method)
    assert np.all(made.rational.poles.real < 0.0)
    assert made.rational.response(0.0) == pytest.approx(g.gain, rel=1e-12)
    accuracy = measure(g, made)
    assert abs(accuracy.static_gain_percent) < 1e-10
    # Orders below 1 are the hardest: their steps go on for ever.
    assert accuracy.max_step_percent < (1.5 if name == "below 1" else 0.2)
    assert accuracy.max_db < 0.1
    assert accuracy.max_deg < 3.0
    assert accuracy.rms_db <= accuracy.max_db


@pytest.mark.parametrize("name", MODELS)
def test_fitted_beats_oustaloup_at_equal_order(name: str) -> None:
    g = MODELS[name]
    theirs = approximate(g, "oustaloup", order=2)
    ours = approximate(g, "fitted", theirs.band, theirs.rational.states)
    assert ours.rational.states == theirs.rational.states
    one, other = measure(g, ours), measure(g, theirs)
    assert one.max_db < 0.2 * other.max_db
    assert one.max_deg < 0.2 * other.max_deg
    assert one.max_step_percent < 0.6 * other.max_step_percent


def test_the_operators_make_the_whole() -> None:
    g = TABLE_I
    made = approximate(g, "oustaloup", order=3)
    omega = np.geomspace(0.001, 1000.0, 50)
    upper, lower = (part.response(omega) for part in made.operators)
    whole = g.b0 / (upper + g.a1 * lower + g.a0)
    assert made.rational.response(omega) == pytest.approx(whole, rel=1e-10)


@pytest.mark.parametrize("order", [2, 10, 25])
@pytest.mark.parametrize("name", MODELS)
def test_the_state_space_form_keeps_the_digits(name: str, order: int) -> None:
    rational = approximate(MODELS[name], "oustaloup", order=order).rational
    form = rational.state_space()
    omega = np.geomspace(0.001, 1000.0, 30)
    eye = np.eye(rational.states)
    found = [
        (form.C @ np.linalg.solve(1j * w * eye - form.A, form.B) + form.D)[0, 0] for w in omega
    ]
    assert np.asarray(found) == pytest.approx(rational.response(omega), rel=1e-9)


def test_the_measured_error_is_the_error() -> None:
    """An approximation of another model errs by the difference of the two."""
    band = Band(0.01, 100.0)
    made = approximate(TABLE_I, band=band)
    louder = replace(TABLE_I, b0=1.1 * TABLE_I.b0)
    accuracy = measure(louder, made)
    assert accuracy.max_db == pytest.approx(20 * np.log10(1.1), abs=0.02)
    assert accuracy.max_deg < 0.1
    assert accuracy.static_gain_percent == pytest.approx(100 * (1 / 1.1 - 1))
    assert accuracy.max_step_percent > 9.0


@pytest.mark.parametrize("name", MODELS)
def test_the_default_band_holds_the_models_time_scales(name: str) -> None:
    g = MODELS[name]
    band = default_band(g)
    low, high = abs(exact_response(g, np.array([band.low, band.high])))
    assert low == pytest.approx(g.gain, rel=0.25)
    assert high < 0.1 * g.gain
    sampled = default_band(g, 0.1)
    assert sampled.low == band.low
    assert sampled.high <= band.high


def test_a_small_order_leaves_a_band_that_can_be_approximated() -> None:
    for alpha1, a1 in ((0.2, 5.0), (0.2, 7.0), (0.02, 1.5), (0.01, 0.5)):
        g = TransferFunction(1.4, alpha1, a1, 1.0, 0.9)
        for interval in (None, 0.02):
            band = default_band(g, interval)
            assert band.low < 1.0 < band.high
            assert approximate(g, "oustaloup", band).rational.states > 0


def test_a_wide_band_is_approximated_no_further_than_it_may_be() -> None:
    band = Band(1e-4, 1e4)
    reach = band.widened(10.0)
    assert reach.low < band.low
    assert band.high < reach.high <= 1e9 * reach.low
    widest = Band(1e-4, 1e5)
    assert widest.widened(10.0) == widest


def test_bands_and_orders_that_are_none() -> None:
    for ends in ((1.0, 1.0), (0.0, 1.0), (2.0, 1.0), (1e-9, 1e9)):
        with pytest.raises(ValueError, match="expected"):
            Band(*ends)
    with pytest.raises(ValueError, match="order of 3 to 24"):
        approximate(TABLE_I, "fitted", order=2)
    with pytest.raises(ValueError, match="expected a method"):
        approximate(TABLE_I, "pade")


# --- discrete filters ---------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", MODELS)
def test_a_held_input_is_filtered_exactly(name: str, method: str) -> None:
    rational = approximate(MODELS[name], method).rational
    t = np.arange(200) * 0.05
    made = discretise(rational, 0.05)
    assert made.run(np.ones(200)) == pytest.approx(rational.step(t), abs=1e-7 * rational.gain)


@pytest.mark.parametrize("name", MODELS)
def test_single_precision_holds_up(name: str) -> None:
    g = MODELS[name]
    made = discretise(approximate(g).rational, 0.02)
    accuracy = measure_filter(g, made, 60.0)
    assert accuracy.max_step_percent < 0.2
    assert accuracy.single_step_percent < accuracy.max_step_percent + 0.1
    assert accuracy.seconds == pytest.approx(59.98)


def test_tustin_is_of_second_order_for_a_smooth_input() -> None:
    rational = approximate(TABLE_I).rational
    errors = []
    for T in (0.1, 0.05):
        t = np.arange(round(20.0 / T)) * T
        filtered = discretise(rational, T, "tustin").run(np.sin(0.7 * t))
        late = t > 15.0
        response = rational.response(0.7)
        steady = np.abs(response) * np.sin(0.7 * t + np.angle(response))
        errors.append(np.max(np.abs(filtered - steady)[late]))
    # The transient is left out by the late window only in part: its share does not halve.
    assert errors[1] < errors[0]
    assert errors[1] < 1e-3 * rational.gain * 5


def test_dead_time_becomes_whole_samples() -> None:
    made = discretise(approximate(TABLE_I).rational, 0.02, delay_s=0.11)
    assert made.delay_samples == 6  # 5.5, to the even neighbour
    plain = discretise(approximate(TABLE_I).rational, 0.02)
    assert made.run(np.ones(50))[6:] == pytest.approx(plain.run(np.ones(50))[:-6])


# --- python-control -----------------------------------------------------------------------------


def compare_with_control(system: Any, made: Approximation, g: TransferFunction) -> None:
    omega = np.geomspace(made.band.low, made.band.high, 40)
    assert np.asarray(system(1j * omega)) == pytest.approx(made.rational.response(omega), rel=1e-9)
    t = np.linspace(0.0, 20.0, 201)
    _, y = control.step_response(system, t)
    assert y == pytest.approx(made.rational.step(t), abs=1e-8)
    assert y == pytest.approx(exact(g, t), abs=2e-3 * g.gain)
    assert control.dcgain(system) == pytest.approx(g.gain, rel=1e-10)


@pytest.mark.parametrize("method", METHODS)
def test_the_round_trip_through_python_control(method: str) -> None:
    exported = export_model(PLAIN, Options(method=method))
    system = Model(PLAIN).to_control(method=method)
    assert isinstance(system, control.StateSpace)
    compare_with_control(system, exported.approximation, TABLE_I)
    assert "step response at most" in system.__doc__


def test_the_python_file_builds_the_same_system(tmp_path: Path) -> None:
    path = Model(PLAIN).export("python-control", tmp_path / "arm.py")
    built = runpy.run_path(str(path))
    compare_with_control(built["actuator"](), export_model(PLAIN).approximation, TABLE_I)
    assert built["REFERENCE_KPA"] == 30.0
    assert "error of the approximation: at most" in built["__doc__"]


def test_a_dead_time_becomes_a_pade_in_python_control(tmp_path: Path) -> None:
    late = replace(PLAIN, effects=(DEAD_TIME,))
    model = Model(late)
    omega = np.geomspace(0.01, 5.0, 20)
    rational = export_model(late).rational
    delayed = rational.response(omega) * np.exp(-0.3j * omega)
    built = runpy.run_path(str(model.export("python-control", tmp_path / "late.py")))["actuator"]()
    for system in (model.to_control(), built):
        assert np.asarray(system(1j * omega)) == pytest.approx(delayed, rel=1e-3)


# --- effects ------------------------------------------------------------------------------------

DEAD_TIME = {"id": "dead_time", "stage": "drive", "parameters": {"delay_s": 0.3}}
LAG = {
    "id": "line_lag",
    "stage": "drive",
    "parameters": {"time_constant_s": 0.5, "second_pole": 0.2},
}
CREEPS = {
    "id": "sensor_lag",
    "stage": "sensor",
    "parameters": {"time_constant_s": 0.1, "second_pole": 0.0},
}


def test_linear_effects_of_the_drive_are_exported() -> None:
    made = export_model(replace(PLAIN, effects=(DEAD_TIME, LAG, CREEPS)))
    omega = np.array([0.5, 2.0])
    lags = 1.0 / ((1 + 0.4j * omega) * (1 + 0.1j * omega))
    plain = made.approximation.rational.response(omega)
    assert made.rational.response(omega) == pytest.approx(plain * lags)
    assert made.part.dead_time_s == 0.3
    assert made.filter.delay_samples == 15
    text = "\n".join(made.statement())
    assert "dead time of the drive: 0.3 s" in text
    assert "not of the actuator, so not included: sensor_lag" in text


def test_the_tail_of_a_lag_is_exported() -> None:
    made = export_model(replace(PLAIN, effects=(with_tail(0.3),)))
    omega = np.array([0.3, 1.0, 4.0])
    quick = 0.5 / 1.9
    first = 1.0 / ((1 + 0.8j * quick * omega) * (1 + 0.2j * quick * omega))
    lag = 0.7 * first + 0.3 / (1 + 4j * quick * omega)
    plain = made.approximation.rational.response(omega)
    assert made.rational.response(omega) == pytest.approx(plain * lag)
    assert "; leads: " in "\n".join(made.statement())
    none = export_model(replace(PLAIN, effects=(with_tail(0.0),)))
    assert none.part.leads_s == ()


def test_a_line_that_vents_otherwise_than_it_fills_is_not_linear() -> None:
    def vents(excess: float) -> Any:
        own = {"parameters": {**LAG["parameters"], "venting_excess": excess}}  # type: ignore[dict-item]
        return export_model(replace(PLAIN, effects=(LAG | own,)), Options(allow_left_out=True))

    as_long, longer = vents(0.05), vents(0.5)
    assert as_long.part.left_out == ()
    assert longer.part.left_out == ("line_lag (a fall takes 1.5 times as long)",)
    assert longer.part.lags_s == as_long.part.lags_s == (0.4, 0.1)


def test_a_rise_that_waits_longer_than_a_fall_is_not_linear() -> None:
    uneven = {"parameters": {"delay_s": 0.3, "uneven": 0.5}}
    made = export_model(replace(PLAIN, effects=(DEAD_TIME | uneven,)), Options(allow_left_out=True))
    assert made.part.left_out == ("dead_time (a rise waits 1.5 times as long)",)
    assert made.part.dead_time_s == 0.3


def test_a_line_that_is_an_orifice_is_not_linear() -> None:
    own = {"parameters": {**LAG["parameters"], "orifice_share": 0.7}}  # type: ignore[dict-item]
    with pytest.raises(BadInput, match=r"line_lag \(70% of it is an orifice's\)"):
        export_model(replace(PLAIN, effects=(LAG | own,)))


def with_tail(share: float) -> dict[str, Any]:
    return LAG | {"parameters": {**LAG["parameters"], "tail_share": share}}  # type: ignore[dict-item]


def slew() -> dict[str, Any]:
    from spa_fo.plant.effects.library import LIBRARY

    form = LIBRARY["slew_limit"]
    values = {one.name: one.starts[0] for one in form.parameters}
    return {"id": "slew_limit", "stage": "drive", "parameters": values}


def test_what_is_not_linear_is_refused_or_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "augmented.json"
    write_model(path, replace(PLAIN, effects=(slew(),)))
    with pytest.raises(SystemExit) as left:
        main(["export", str(path), "--to", "csv"])
    assert left.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "holds slew_limit, which no linear model can hold; --linear-part" in line
    assert sorted(tmp_path.iterdir()) == [path]
    assert main(["export", str(path), "--to", "csv", "--linear-part"]) == 0
    assert "LEFT OUT, this is the linear part only: slew_limit" in (
        tmp_path / "augmented_filter.csv"
    ).read_text(encoding="utf-8")


# --- the command and its files ------------------------------------------------------------------


@pytest.fixture
def model_file(tmp_path: Path) -> Path:
    known = [
        replace(one, error=0.01, low=one.value - 0.02, high=one.value + 0.02, kind="made up")
        for one in bare_estimates(PLAIN)
    ]
    extra = {
        "provenance": {"kind": "synthetic", "source": "virtual rig"},
        "sampling": {"interval_s": 0.04},
        KEY: uncertainty_entry(known),
    }
    path = tmp_path / "model.json"
    write_model(path, replace(PLAIN, extra=extra))
    return path


@pytest.mark.parametrize("target", TARGETS)
def test_every_file_states_errors_provenance_and_uncertainty(
    target: str, model_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", str(model_file), "--to", target]) == 0
    shown = capsys.readouterr()
    written = Path(shown.err.split(": for ")[0])
    text = written.read_text(encoding="utf-8")
    assert written.parent == model_file.parent
    for words in ("error of the approximation: at most", "synthetic data", "made up", "± 0.01"):
        assert words in text
        assert words in shown.out


def test_the_csv_runs_in_scipy_as_its_note_says(model_file: Path) -> None:
    assert main(["export", str(model_file), "--to", "csv"]) == 0
    path = model_file.with_name("model_filter.csv")
    lines = path.read_text(encoding="utf-8").splitlines()
    note = next(line for line in lines if "skiprows" in line)
    skip = int(note.split("skiprows=")[1].split(",")[0])
    sos = np.loadtxt(path, delimiter=",", skiprows=skip, usecols=range(1, 7))
    t = np.arange(500) * 0.04  # the interval of the model's logs
    assert "# sample_time_s = 0.04" in lines
    assert sosfilt(sos, np.ones(500)) == pytest.approx(exact(TABLE_I, t), abs=1e-3)


def test_the_csv_runs_on_a_board_as_its_note_says(model_file: Path) -> None:
    main(["export", str(model_file), "--to", "csv", "--sample-time", "0.1"])
    path = model_file.with_name("model_filter.csv")
    rows = [line for line in path.read_text(encoding="utf-8").splitlines() if line[0] != "#"]
    sections = [[float(v) for v in row.values()] for row in csv.DictReader(rows)]
    state = [[0.0, 0.0] for _ in sections]
    angles = []
    for _ in range(100):
        x = 1.0
        for (_, b0, b1, b2, _, a1, a2), s in zip(sections, state, strict=True):
            y = b0 * x + s[0]
            s[0], s[1] = b1 * x - a1 * y + s[1], b2 * x - a2 * y
            x = y
        angles.append(x)
    assert angles == pytest.approx(exact(TABLE_I, np.arange(100) * 0.1).tolist(), abs=1e-3)


def test_the_json_holds_operators_and_whole(model_file: Path) -> None:
    out = model_file.with_name("filters.json")
    options = ["--to", "oustaloup", "--band", "0.01", "100", "--order", "3", "--out", str(out)]
    assert main(["export", str(model_file), *options]) == 0
    document = json.loads(out.read_text(encoding="utf-8"))
    assert document["N"] == 3
    assert document["band_rad_per_s"] == [0.01, 100.0]
    assert [len(one["zeros"]) for one in document["operators"]] == [7, 7]
    whole = document["whole"]
    s = 0.7j
    poles = np.array([p["re"] + 1j * p["im"] for p in whole["poles"]])
    value = whole["gain"] * np.prod(s - np.array(whole["zeros"])) / np.prod(s - poles)
    assert value == pytest.approx(exact_response(TABLE_I, np.array([0.7]))[0], rel=0.02)
    assert document["errors"]["max_db"] > 0.0


def test_the_figure_is_written(model_file: Path) -> None:
    picture = model_file.with_name("bode.png")
    assert main(["export", str(model_file), "--to", "csv", "--figure", str(picture)]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert picture.with_suffix(".pdf").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--to", "csv", "--band", "2", "1"], "--band: expected two rising positive frequencies"),
        (["--to", "csv", "--order", "99"], "expected an order of 3 to 24 for fitted, not 99"),
        (["--to", "oustaloup", "--method", "fitted"], "--to oustaloup needs its own"),
    ],
)
def test_bad_options_take_one_line(
    options: list[str], words: str, model_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main(["export", str(model_file), *options])
    assert left.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line
    assert sorted(model_file.parent.iterdir()) == [model_file]


def test_the_commands_choices_are_the_packages() -> None:
    from spa_fo import export_cli

    assert export_cli.TARGETS == TARGETS
    assert export_cli.METHODS == METHODS
    assert export_cli.HOLDS == HOLDS


def test_no_place_to_write_is_said() -> None:
    with pytest.raises(BadInput, match="expected a file"):
        Model(PLAIN).export("csv")


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="needs Debian's octave")
def test_the_script_runs_in_octave(tmp_path: Path) -> None:
    control_package = subprocess.run(
        ["octave-cli", "--no-init-file", "--eval", "pkg load control"], capture_output=True
    )
    if control_package.returncode:
        pytest.skip("needs Debian's octave-control")
    made = export_model(PLAIN)
    script = Model(PLAIN).export("simulink", tmp_path / "arm.m")
    ask = (
        f"run('{script}'); w = [0.1 1 10]; "
        "h = squeeze(freqresp(actuator.sys, w)); z = squeeze(freqresp(actuator.sysz, w)); "
        "y = ones(200, 1); for k = 1:rows(actuator.sos) "
        "y = filter(actuator.sos(k, 1:3), actuator.sos(k, 4:6), y); end; "
        "d = lsim(actuator.sysd, ones(200, 1)); "
        "printf('%.15g ', real(h), imag(h), real(z), imag(z), y(end), d(end))"
    )
    run = subprocess.run(
        ["octave-cli", "--no-init-file", "--eval", ask], capture_output=True, text=True, check=True
    )
    values = [float(word) for word in run.stdout.split()]
    response = made.rational.response(np.array([0.1, 1.0, 10.0]))
    both = [*response.real, *response.imag]
    assert values[:12] == pytest.approx([*both, *both], rel=1e-8)
    last = exact(TABLE_I, np.array([199 * made.filter.sample_time_s]))[0]
    assert values[12:] == pytest.approx([last, last], rel=1e-3)
