"""Measured data: the models and records that are made of them are what they should be."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import hilbert

import radiation_ss as rss

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import kvlcc2_roll, ntnu_section, ntnu_waves
from radiation_ss.effects import effect_named


def test_section_solver_gives_the_published_table_of_the_section(data):
    """The nominal model is the solver's; the table came with the measurements, from another panel method."""
    table = ntnu_section.table(data / "ntnu_section" / "bem_deepwater_L0p586.csv")
    model = ntnu_section.nominal()
    for name, (i, j) in {"22": (0, 0), "33": (1, 1), "44": (2, 2), "24": (0, 2)}.items():
        for what, values in (("A", model.A), ("B", model.B)):
            ours = np.interp(table["omega_rad_s"], model.omega, values[:, i, j])
            largest = np.abs(table[what + name]).max()
            np.testing.assert_allclose(ours, table[what + name], atol=0.01 * largest, err_msg=what + name)


def test_every_pair_of_runs_saw_the_same_wave(data):
    folder = data / "ntnu_section"
    runs = [pair for pair in ntnu_section.pairs(folder) if pair[0].startswith("free_sway_heave/")]
    assert len(runs) >= 3
    for free, fixed in runs:
        record = ntnu_section.record(folder, free, fixed, ("Heave",))
        assert float(record.meta["wavemaker misfit"]) < 0.01
        motion = record.channels["Heave_velocity"]
        assert np.std(motion[record.time < record.time[0] + 1.0]) < 0.05 * np.std(motion)
        # The camera resolves 1 mm and reads low; its size is the accelerometers' to a fifth all the same.
        seen = ntnu_section.record(folder, free, fixed, ("Heave",), camera=True).channels["Heave"]
        assert np.std(motion) == pytest.approx(float(record.meta["omega"]) * np.std(seen), rel=0.2)


def test_probe_in_front_of_the_model_confirms_the_clock_of_the_wavemaker(data):
    """Before the model's own waves are back at the first probe, both runs show it the same incident wave."""
    folder = data / "ntnu_section"
    runs = ntnu_section.manifest(folder)
    free_name, fixed_name = "free_sway_heave/4041_1.csv", "fixed/2041.csv"
    free, fixed = ntnu_section.table(folder / free_name), ntnu_section.table(folder / fixed_name)
    shift, _, _ = ntnu_section.lag(free, fixed, (runs[free_name], runs[fixed_name]))
    moved = np.interp(free["time_s"], fixed["time_s"] + shift, fixed["wp1_m"])
    start = runs[free_name]["wavemaker_start_s"]
    window = (free["time_s"] > start + 3.0) & (free["time_s"] < start + 10.0)
    assert np.std((moved - free["wp1_m"])[window]) < 0.05 * np.std(free["wp1_m"][window])


def steady(run, marks):
    return (run["time_s"] > marks["steady_from_s"]) & (run["time_s"] < marks["reflection_back_s"])


@pytest.mark.parametrize("name", ["free_heave_roll/6041_1.csv", "free_heave_roll/6061_1.csv.gz"])
def test_what_a_sway_accelerometer_reads_with_the_sway_clamped_is_gravity(data, name):
    """Roll of 0.2 rad about a clamped sway: nine tenths of the reading go with the roll angle and its acceleration."""
    folder = data / "ntnu_section"
    marks = ntnu_section.manifest(folder)[name]
    run = ntnu_section.table(folder / name)
    angle, _ = ntnu_section.tilt(run, marks)
    keep = steady(run, marks)
    assert np.std(angle[keep]) > 0.1
    assert np.std(ntnu_section.level(run, marks)[keep]) < 0.15 * np.std(ntnu_section.read(run, marks, "Sway")[keep])
    # Another instrument sees the same roll: the camera, whose roll counts the other way and is coarse.
    assert np.std(angle[keep]) == pytest.approx(np.std(run["roll_cam_rad"][keep]), rel=0.15)


def test_slow_sway_is_that_of_springs_and_camera_and_not_of_the_accelerometer(data):
    folder = data / "ntnu_section"
    for name in ("free_sway_heave/4061_1.csv.gz", "free_sway_heave/4101_2.csv"):
        marks = ntnu_section.manifest(folder)[name]
        run = ntnu_section.table(folder / name)
        time, omega = run["time_s"], marks["omega_rad_s"]
        keep = (time > marks["front_at_model_s"] - 3.0) & (time < marks["reflection_back_s"])

        def drift(displacement, time=time, omega=omega, keep=keep):
            return np.gradient(ntnu_section.slow(time, displacement, omega), time)[keep]

        springs = drift(ntnu_section.pull(run, marks) / ntnu_section.SWAY_SPRING)
        camera = drift(ntnu_section.still(run, marks, "sway_cam_m"))
        alone = ntnu_section.as_read(time[keep], ntnu_section.read(run, marks, "Sway")[keep])
        alone = ntnu_section.slow(time[keep], alone, omega)
        ours = ntnu_section.slow(time, ntnu_section.velocity(run, marks, "Sway"), omega)[keep]
        assert np.corrcoef(springs, camera)[0, 1] > 0.8
        assert np.std(ours - camera) < 0.5 * np.std(alone - camera)


def test_second_order_force_of_a_higher_wave_is_scaled_by_the_square():
    time, omega, ratio = np.arange(0.0, 60.0, 0.02), 5.0, 1.7
    first, second = np.sin(omega * time), 0.1 + 0.2 * np.cos(2.0 * omega * time)
    lower = ntnu_section.scaled(time, ratio * first + ratio**2 * second, ratio, omega)
    inner = slice(500, -500)
    np.testing.assert_allclose(lower[inner], (first + second)[inner], atol=0.01)


def packet(omega, centre, width, arrival, time):
    """Return amplitudes, frequencies and a function of the path k y for a packet that passes y = 0 at `arrival`."""
    w = omega[(omega > centre - 6.0 * width) & (omega < centre + 6.0 * width)]
    a = np.exp(-0.5 * ((w - centre) / width) ** 2)
    return w, lambda path: 1e-3 * np.cos(np.outer(time - arrival, w) + path) @ a


def test_waves_of_both_directions_are_told_apart_and_come_back_from_a_wall():
    """Two packets that meet at the probes; what comes back is a sum of cosines of its own."""
    time, depth, places = 0.05 * np.arange(1600), 1.0, np.array([3.0, 4.95, 5.2, 5.5])
    (w, away), (u, towards) = (packet(0.02 * np.arange(1, 600), centre, 0.3, arrival, time)
                               for centre, arrival in ((5.0, 35.0), (6.0, 40.0)))

    def path(frequencies, place):  # the root of w^2 = g k tanh(k h), by iteration
        k = frequencies**2 / 9.81
        for _ in range(200):
            k = frequencies**2 / 9.81 / np.tanh(k * depth)
        return k * place

    seen = np.stack([away(-path(w, y)) + towards(path(u, y)) for y in places])
    found = ntnu_waves.two_ways(seen, places, 0.05, depth)
    small = 1e-6 * np.abs(seen).max()  # of the packets' tails, six standard deviations out
    np.testing.assert_allclose(found[0].elevation, away(0.0), atol=small)
    np.testing.assert_allclose(found[1].elevation, towards(0.0), atol=small)
    back = ntnu_waves.come_back(found[1], 7.0, depth)
    np.testing.assert_allclose(back.elevation, towards(-path(u, 7.0)), atol=small)


def test_wavemaker_sends_back_what_the_section_sent_to_it(data):
    """The probes see it come back, most of it (side walls take some), as from a wall within 6 cm of its place."""
    folder = data / "ntnu_section"
    runs = ntnu_section.manifest(folder)
    for names in (("free_sway_heave/4041_1.csv", "fixed/2041.csv"),
                  ("free_sway_heave/4061_1.csv.gz", "fixed/2062.csv.gz")):
        free, fixed = (ntnu_section.table(folder / name) for name in names)
        marks = runs[names[0]], runs[names[1]]
        shift, ratio, _ = ntnu_section.lag(free, fixed, marks)
        away, towards = ntnu_section.towards_wavemaker(free, fixed, marks, shift, ratio)
        keep = np.abs(free["time_s"] - marks[0]["reflection_back_s"]) < 5.0
        back, sent = (hilbert(sea.elevation)[keep] for sea in (away, towards))
        part = np.vdot(sent, back) / np.vdot(sent, sent)
        assert 0.85 < abs(part) < 1.0
        assert abs(np.angle(part)) < 2.0 * marks[0]["k_rad_m"] * 0.06
        assert np.linalg.norm(back - part * sent) < 0.05 * np.linalg.norm(back)
        # Hardly anything of it acts before the last third, and a held section's own force is not the free one's there.
        force = ntnu_section.sent_back(free, fixed, marks, shift, ratio, ("Sway",))[0]
        held = ntnu_section.still(fixed, marks[1], "Fy_sway_N")[steady(fixed, marks[1])] / ratio
        end = marks[0]["reflection_back_s"]
        last = (free["time_s"] > end - 2.0) & (free["time_s"] < end)
        early = (free["time_s"] > marks[0]["front_at_model_s"]) & (free["time_s"] < end - 6.0)
        assert np.std(force[early]) < 0.01 * np.std(held)
        assert np.std(force[last]) > 0.03 * np.std(held)


def test_immersion_gives_back_the_energy_that_it_takes():
    """The power of both forces is the rate of -slope x_other v^2 / 2."""
    t, slope = np.linspace(0.0, 3.0, 3001), 150.0
    v, a = np.cos(2.0 * t) + 0.3 * t, -2.0 * np.sin(2.0 * t) + 0.3
    x, w = 0.02 * np.sin(3.0 * t), 0.06 * np.cos(3.0 * t)
    signals = SimpleNamespace(v=v, a=a, other=SimpleNamespace(x=x, v=w))
    one, other = effect_named("immersion").force(signals, SimpleNamespace(slope=slope))
    energy = 0.5 * slope * x * v**2
    power = one * v + other * w
    np.testing.assert_allclose(power[1:-1], -np.gradient(energy, t)[1:-1], atol=1e-4 * np.abs(power).max())


def test_nominal_roll_model_decays_as_the_inviscid_simulation(data):
    folder = data / "kvlcc2_roll"
    time, roll = kvlcc2_roll.columns(folder / kvlcc2_roll.SIMULATED)
    hydro = kvlcc2_roll.nominal(folder)
    M, A, B, C = (float(v) for v in (hydro.M[0, 0], 0.0, 0.0, hydro.C[0, 0]))
    omega, rate = kvlcc2_roll.decay_rate(time, roll)
    A, B = (float(np.interp(omega, hydro.omega, values[:, 0, 0])) for values in (hydro.A, hydro.B))
    assert np.sqrt(C / (M + A)) == pytest.approx(omega, rel=1e-6)
    assert B / (2.0 * (M + A)) == pytest.approx(rate, rel=1e-6)
    # Inertia and stiffness are the stated particulars; added inertia in roll is a tenth to a third of it.
    assert 0.1 < A / M < 0.35
    # Independent count: 140 half periods lie between the first and last of as many crossings.
    zero = kvlcc2_roll.crossings(time, roll)
    assert omega == pytest.approx(np.pi * (zero.size - 1) / (zero[-1] - zero[0]), rel=1e-3)


def test_measured_decay_starts_free_and_damps_more_than_potential_flow(data):
    folder = data / "kvlcc2_roll"
    record = kvlcc2_roll.measured(folder)
    assert record.kind == "decay" and record.dofs == ("Roll",)
    assert np.abs(record.channels["Roll"]).argmax() == 0
    omega, rate = kvlcc2_roll.decay_rate(record.time, record.channels["Roll"])
    simulated_omega, simulated_rate = kvlcc2_roll.decay_rate(*kvlcc2_roll.columns(folder / kvlcc2_roll.SIMULATED))
    assert omega == pytest.approx(simulated_omega, rel=5e-3)
    assert rate > 2.0 * simulated_rate


def test_files_are_read_back_as_written(data, tmp_path):
    files = kvlcc2_roll.build(data / "kvlcc2_roll", tmp_path)
    model = rss.read_hydro(files[0])
    assert model.dofs == ("Roll",) and model.A_inf is not None and model.C is not None
    seen, withheld = (rss.read_record(tmp_path / f"kvlcc2_run1_{name}.csv") for name in ("seen", "withheld"))
    assert seen.time[-1] < withheld.time[0]
    whole = rss.read_record(tmp_path / "kvlcc2_run1.csv")
    assert seen.time.size + withheld.time.size == whole.time.size
