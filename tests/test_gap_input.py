"""Records that do not fit the model or hold too little: a clear word, never a confident verdict."""

import numpy as np
import pytest
from gap_cases import tank_case

from radiation_ss.design.isolability import isolability
from radiation_ss.errors import InputError
from radiation_ss.gap.diagnose import diagnose
from radiation_ss.records.record_checks import without_clipped
from radiation_ss.simulation.unit_checks import check_units

DRAG = [("quadratic_drag", {"coefficient": 150.0})]


@pytest.mark.parametrize("factor", [1000.0, 180.0 / np.pi, 1e-3])
@pytest.mark.parametrize("seed", [1, 2])
def test_wrong_unit_is_refused(factor, seed):
    model, (decay, waves) = tank_case(DRAG, seed=seed, kinds=("decay", "waves"), duration=15.0)
    check_units(model, [decay, waves])
    wrong = waves.with_channels(Heave=factor * waves.channels["Heave"])
    with pytest.raises(InputError, match="check the units"):
        diagnose(model, [decay, wrong])


def test_noise_and_foreign_motion_are_refused():
    model, (decay,) = tank_case([], seed=1, kinds=("decay",), duration=15.0)
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="only noise"):
        diagnose(model, decay.with_channels(Heave=1e-3 * rng.standard_normal(decay.time.size)))
    with pytest.raises(InputError, match="degrees of freedom"):
        diagnose(model, type(decay)(decay.time, {"Roll": decay.channels["Heave"], "Roll_force": 0.0 * decay.time},
                                    kind="decay"))
    with pytest.raises(InputError, match="tolerance"):
        diagnose(model, decay, tolerance=None)


def test_an_empty_library_is_refused():
    model, (decay,) = tank_case([], seed=1, kinds=("decay",), duration=15.0)
    moved = type(decay)(decay.time, {"Heave": decay.channels["Heave"]}, kind="motion-only")
    for ask in (diagnose, isolability):
        for record in (decay, moved):
            with pytest.raises(InputError, match="effects: an empty list"):
                ask(model, record, effects=[])


@pytest.mark.parametrize("seed", [1, 2])
def test_clipped_samples_are_left_out_and_the_rest_tells_the_effect(seed):
    model, records = tank_case(DRAG, seed=seed, kinds=("decay", "waves"), duration=20.0)
    waves = records[1].channels["Heave"]
    level = 0.8 * waves.std()
    short = records[1].with_channels(Heave=np.clip(waves, -level, level))
    kept, said = without_clipped(short)
    assert len(said) == 1 and "left out" in said[0]
    assert np.isnan(kept.channels["Heave"]).sum() == (np.abs(waves) >= level).sum()
    assert np.array_equal(without_clipped(records[1])[0].channels["Heave"], waves)
    found = diagnose(model, [records[0], short], ["quadratic_drag", "actuator_saturation", "cubic_stiffness"],
                     pairs=False)
    assert [e.name for e in found.verdict.effects] == ["quadratic_drag"]
    value, deviation = found.verdict.effects[0].parameters["coefficient"]
    assert abs(value - 150.0) < 3.0 * deviation
    assert any("clipped" in note for note in found.notes)
