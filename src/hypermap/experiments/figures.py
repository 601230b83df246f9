"""All figures of an experiment as plain values, for JSON and for its tables."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import version

from hypermap._version import __version__
from hypermap.evaluation.significance import effect_of, signed_rank
from hypermap.experiments.breakdown import (
    KINDS,
    by_class,
    by_object,
    grouped,
    objects_of,
    recall_of,
)
from hypermap.experiments.calibration import calibration_error
from hypermap.experiments.confusion import Confusion
from hypermap.experiments.localization import LIMITS, localization_curve
from hypermap.experiments.methods import OURS, PUBLISHED, Method, settings_of
from hypermap.experiments.results import MEASURES, Data, WorldResult, mean
from hypermap.simulation import Errors, World

POSE_ERRORS = ("ate", "ate_deg", "rpe", "rpe_deg")


def to_data(results: Sequence[WorldResult]) -> Data:
    """Return all figures as plain values, for JSON."""
    return {
        "worlds": [_world(result) for result in results],
        "rule": (
            "For every true object the estimated one of its class with the nearest centroid, "
            "moved so that the centroids coincide (thesis, 2019); p: paired one-sided Wilcoxon "
            f"signed-rank test of whether {OURS} is better, over true objects, each with its mean "
            "over the drives; gain: their mean, with Student's interval of 95 %"
        ),
        "localization_limits": LIMITS,
    }


def made_with(worlds: Iterable[World], errors: Errors, methods: Mapping[str, Method]) -> Data:
    """Return all that figures depend on besides seeds: versions, settings and what is in a world.

    Args:
        worlds: as their files describe them; a seed may move and change furniture.
        errors: of the drives.
        methods: by name.
    """
    packages = ("numpy", "scipy", "shapely", "numba")
    return {
        "versions": {
            "hypermap": __version__,
            "python": platform.python_version(),
            **{name: version(name) for name in packages},
        },
        "worlds": {world.name: asdict(world) for world in worlds},
        "errors": _finite(asdict(errors)),
        "methods": {name: _finite(settings_of(method)) for name, method in methods.items()},
    }


def _finite(data: Data) -> Data:
    """Return settings with "inf" for infinite numbers, which JSON does not have."""
    return {
        key: _finite(value)
        if isinstance(value, dict)
        else "inf"
        if value == float("inf")
        else value
        for key, value in data.items()
    }


def _world(result: WorldResult) -> Data:
    drives = [mapped.drive for mapped in result.mapped]
    return {
        "world": result.world.name,
        "objects": len(result.truth),
        "seeds": [drive.seed for drive in drives],
        "frames": result.mapped[0].frames,
        "bound": result.bound(),
        "drives": [_drive(result, place) for place in range(len(drives))],
        "methods": {name: _method(result, name) for name in result.evaluations},
    }


def _drive(result: WorldResult, place: int) -> Data:
    """Return what one drive shows, and what each method makes of it."""
    mapped = result.mapped[place]
    scores = {name: of[place].overall for name, of in result.evaluations.items()}
    return {
        "seed": mapped.drive.seed,
        "frames": mapped.frames,
        "detected": mapped.sightings.share(),
        "detected_twice": mapped.sightings.share(at_least=2),
        "methods": {
            name: {
                "iou": score.shape_iou,
                "distance": score.shape_distance,
                "at": [
                    {"min_iou": d.min_iou, "precision": d.precision, "recall": d.recall, "f1": d.f1}
                    for d in score.detection
                ],
            }
            for name, score in scores.items()
        },
    }


def _method(result: WorldResult, name: str) -> Data:
    iou, distance = result.shape(name)
    published = PUBLISHED.get((name, result.world.name))
    bins = result.reliability(name)
    confusion = Confusion.of(result.maps(name))
    data = {
        "iou": iou,
        "distance": distance,
        "published": None if published is None else vars(published),
        "classes": {
            class_: dict(zip(("iou", "distance"), result.shape(name, class_), strict=True))
            for class_ in result.classes()
        },
        **result.found(name),
        "intervals": _intervals(result, name),
        "average_precision": result.average_precision(name),
        "reliability": [vars(one) for one in bins],
        "calibration_error": calibration_error(bins),
        **_breakdown(result, name),
        "confusion": {"classes": confusion.classes, "counts": confusion.counts.tolist()},
        "localization": localization_curve(result.maps(name)),
        "poses": _poses(result, name),
    }
    if name != OURS and OURS in result.evaluations:
        for measure in ("iou", "distance"):
            gains = result.gains(OURS, name, measure)
            has_any = len(gains) > 0
            data[f"p_{measure}"] = signed_rank(gains).p if has_any else None
            data[f"gain_{measure}"] = vars(effect_of(gains)) if has_any else None
    return data


def _intervals(result: WorldResult, name: str) -> Data:
    """Return the mean over the drives of each of `MEASURES`, and its interval."""
    scores = [evaluation.overall for evaluation in result.evaluations[name]]
    found: Data = {}
    for key, measure in MEASURES.items():
        values = [value for value in map(measure.of, scores) if value is not None]
        effect = effect_of(values) if values else None
        found[key] = effect and {"mean": effect.mean, "low": effect.low, "high": effect.high}
    return found


def _breakdown(result: WorldResult, name: str) -> Data:
    """Return recall of what was seen, and figures of groups of the true objects."""
    objects = objects_of(result, name)
    groups = {kind: grouped(objects, how) for kind, how in KINDS.items()}
    groups |= {"class": by_class(objects), "object": by_object(objects)}
    return {
        "recall_of_seen": recall_of(objects, 1, "views"),
        "recall_of_detected": recall_of(objects, 1, "detections"),
        "recall_of_detected_twice": recall_of(objects, 2, "detections"),
        "groups": {kind: [vars(group) for group in some] for kind, some in groups.items()},
    }


def _poses(result: WorldResult, name: str) -> Data | None:
    """Return means over the drives of the errors of the poses; None for code of a package."""
    drives = [mapped.poses[name] for mapped in result.mapped if name in mapped.poses]
    if not drives:
        return None
    return {
        when: {key: mean([getattr(drive[place], key) for drive in drives]) for key in POSE_ERRORS}
        for place, when in enumerate(("given", "used"))
    }
