"""Healthy but special measurements: motions that stand, repeat, are rounded, tiny, huge or proportional."""

import numpy as np
from gap_cases import tank_case
from plant_bodies import coupled_model

import radiation_ss as rss


def degenerate() -> dict[str, tuple]:
    """Return (model, records) of healthy but special measurements."""
    body, records = tank_case([("linear_damping", "Heave", {"coefficient": 8.0})], 1, duration=15.0)
    first, other = records[0], records[2]
    t = first.time

    def with_motion(values, record=first, **channels):
        return record.with_channels(Heave=values, **channels)

    two = coupled_model(("Sway", "Roll"))
    same = np.cos(1.1 * t) * np.exp(-0.02 * t)
    pair = rss.Record(t, {"Sway": same, "Roll": 0.1 * same, "Sway_force": 0.0 * t, "Roll_force": 0.0 * t}, kind="decay")
    free = two.replace(C=np.diag([0.0, two.C[1, 1]]))
    x = first.channels["Heave"]
    return {
        "at rest": (body, [with_motion(0.0 * t)]), "the same record twice": (body, [first, first]),
        "one of ten samples": (body, [first.window(t[0], t[10])]),
        "one of three samples": (body, [first.window(t[0], t[3])]),
        "all motion missing": (body, [with_motion(np.full(t.size, np.nan)), other]),
        "one sample known": (body, [with_motion(np.where(np.arange(t.size) == 5, 0.01, np.nan)), other]),
        "rounded to two values": (body, [with_motion(np.round(x / x.max()) * x.max()), other]),
        "a sensor that stands": (body, [with_motion(x, Heave_velocity=0.0 * t), other]),
        "two sensors alike": (body, [with_motion(x, Heave_velocity=np.gradient(x, t), Heave_acceleration=np.gradient(
            np.gradient(x, t), t))]),
        "no force in waves": (body, [rss.Record(t, {"Heave": x, "Heave_force": 0.0 * t + 1e-300}, kind="forced")]),
        "a constant force": (body, [rss.Record(t, {"Heave": x, "Heave_force": 0.0 * t + 5.0}, kind="forced")]),
        "one sine": (body, [rss.Record(t, {"Heave": 0.01 * np.sin(5.0 * t), "Heave_force": np.sin(5.0 * t)},
                                       kind="forced")]),
        "a force that is the motion": (body, [rss.Record(t, {"Heave": x, "Heave_force": x}, kind="forced")]),
        "1e9 times too large": (body, [with_motion(1e9 * x)]), "1e-9 of the size": (body, [with_motion(1e-9 * x)]),
        "1e50": (body, [with_motion(1e50 * x)]), "1e-200": (body, [with_motion(1e-200 * x)]),
        "two modes that move alike": (two, [pair]), "no restoring": (free, [pair]),
        "no radiation": (body.replace(fit=body.fit.replace(c=0.0 * body.fit.c)), records[:3]),
        "no states": (body.replace(fit=rss.RadiationFit(("Heave",), np.zeros((0, 0)), np.zeros((0, 1)),
                                                        np.zeros((1, 0)), 0)), records[:3]),
        "masses nearly singular": (two.replace(M=two.M - 0.6 * two.M, A_inf=1e6 * np.array(
            [[1.0, 0.999999], [0.999999, 1.0]])), [pair]),
        "static": (body, [rss.Record(t[:4], {"Heave": [0.0, 1e-3, 2e-3, 3e-3],
                                             "Heave_force": [0.0, 0.6, 1.2, 1.7]}, kind="static"), first])}
