"""What records of motion alone can tell apart: Whittle's information on nonlinear effects, the ratio of two sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.design.information import Information, strongest
from radiation_ss.effects import Effect, Scales
from radiation_ss.gap.motion.spectra import Even, Spectra, even_records, information, spectra_of, visible
from radiation_ss.gap.posterior.setting import Term, at_place, shapes_of
from radiation_ss.gap.where.two_sensors import fault, ratio_rows
from radiation_ss.records.record import Record

SENSORS = ("sensor_gain", "sensor_delay")  # in the order in which the ratio of two sensors gives them


def motion_map(model: Model, records: Sequence[Record],
               pool: Sequence[Effect]) -> tuple[tuple[str, ...], FloatArray, FloatArray]:
    """Return labels, detectability (k,) and separation (k, k); what an unknown force absorbs has 0.

    Parameters
    ----------
    model : Model
    records : sequence of Record
        With the displacement of every degree of freedom.
    pool : sequence of Effect

    Raises
    ------
    InputError
        If no record measures the displacement of every degree of freedom.
    """
    scales, _, evens = even_records(model, records)
    blind, A = nonlinear(model, evens, pool, scales)
    sensing, blocks = sensors(model, records, pool, scales)
    terms = [*blind, *sensing]
    ends = np.cumsum([len(term.strengths) for term in terms]).astype(int)
    places = tuple(np.arange(end - len(term.strengths), end) for term, end in zip(terms, ends))
    found = Information(tuple(terms), places, 0, block_diag(A, *blocks)[None])
    return padded(found, untestable(model, pool, {term.key for term in terms}, scales))


def nonlinear(model: Model, evens: Sequence[Even], pool: Sequence[Effect],
              scales: Mapping[str, Scales]) -> tuple[list[Term], FloatArray]:
    """Return the best seen start of each nonlinear effect, and their information together."""
    kept: list[tuple[Term, list[Spectra]]] = []
    for effect in filter(visible, pool):
        for dof in model.dofs:
            tried = [(term, [spectra_of(model, even, term) for even in evens])
                     for term in shapes_of(effect, dof, "", scales[dof])]
            kept.append(max(tried, key=lambda one: strongest(information(one[1], np.zeros(len(one[0].strengths))))))
    if not kept:
        return [], np.zeros((0, 0))
    together = [replace(found[0], response=np.concatenate([one.response for one in found], axis=3))
                for found in zip(*(spectra for _, spectra in kept))]
    return [term for term, _ in kept], information(together, np.zeros(together[0].response.shape[3]))


def sensors(model: Model, records: Sequence[Record], pool: Sequence[Effect],
            scales: Mapping[str, Scales]) -> tuple[list[Term], list[FloatArray]]:
    """Return gain and delay of each degree of freedom that two sensors measure, with their information.

    The ratio of acceleration to displacement is -w^2 (1 + i w delay) / (1 + gain): to first order the errors of the
    two are those of the ratio's own two numbers.
    """
    asked = {effect.name: effect for effect in pool}
    terms: list[Term] = []
    blocks: list[FloatArray] = []
    for dof in model.dofs:
        rows = [row for record in records for row in ratio_rows(record, dof, scales[dof].omega)]
        kept = [k for k, name in enumerate(SENSORS) if name in asked]
        if not rows or not kept:
            continue
        _, _, covariance = fault(rows)
        own = [shapes_of(asked[SENSORS[k]], dof, "", scales[dof])[0] for k in kept]
        size = np.array([term.spread[0] for term in own])
        blocks.append(np.asarray(np.linalg.inv(covariance[np.ix_(kept, kept)]) * np.outer(size, size), np.float64))
        terms += own
    return terms, blocks


def untestable(model: Model, pool: Sequence[Effect], known: set[tuple[str, str, str]],
               scales: Mapping[str, Scales]) -> list[str]:
    """Return labels of the effects that the unknown force, or the lack of a second sensor, hides."""
    found = []
    for effect in pool:
        for dof, other in effect.places(model.dofs):
            term = shapes_of(effect, dof, other, at_place(scales, dof or model.dofs[0], other))[0]
            if term.key not in known:
                found.append(term.active.label)
    return found


def padded(found: Information, hidden: Sequence[str]) -> tuple[tuple[str, ...], FloatArray, FloatArray]:
    """Return the map, best seen first, with rows of zero for what is hidden."""
    size, left = found.detectability([0]), found.separation([0])
    order = np.argsort(-size, kind="stable")
    k, more = len(found.labels), len(hidden)
    separation = np.zeros((k + more, k + more))
    separation[:k, :k] = left[np.ix_(order, order)]
    separation[:k, k:] = size[order][:, None]
    labels = (*(found.labels[i] for i in order), *hidden)
    return labels, np.concatenate([size[order], np.zeros(more)]), separation
