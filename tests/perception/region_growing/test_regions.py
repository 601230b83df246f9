from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from hypermap.perception.region_growing.padded import FAR, MARGIN
from hypermap.perception.region_growing.regions import NOTHING, SEARCH, join

HEIGHT, WIDTH = 21, 37
COSINE = np.float32(0.9)


def scene(seed: int) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Return planes of points a step apart, their normals, and how far each reaches (squared)."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    z = rng.normal(0, 0.8, (HEIGHT, WIDTH))
    normals = rng.normal(0, 0.12, (3, HEIGHT, WIDTH)) + (v > 9) * np.array([[[1]], [[0]], [[0]]])
    normals[2] += 1
    normals /= np.linalg.norm(normals, axis=0)
    reach2 = rng.uniform(1, 12, (HEIGHT, WIDTH))
    inner = (..., slice(MARGIN, MARGIN + HEIGHT), slice(MARGIN, MARGIN + WIDTH))
    shape = (HEIGHT + 2 * MARGIN, WIDTH + 2 * MARGIN)
    planes, axes = np.full((3, *shape), FAR), np.zeros((3, *shape), np.float32)
    reaches = np.full(shape, -1, np.float32)
    planes[inner], axes[inner], reaches[inner] = (u, v, z), normals, reach2
    return planes, axes, reaches


def hang_together(
    planes: NDArray[np.float32],
    normals: NDArray[np.float32],
    reach2: NDArray[np.float32],
    places: NDArray[np.int32],
) -> NDArray[np.int32]:
    """Return the components of the graph of all pairs that join."""
    stride = planes.shape[2]
    rows, columns = np.divmod(places, stride)
    down, right = rows - rows[:, np.newaxis], columns - columns[:, np.newaxis]
    is_below = (down > 0) | ((down == 0) & (right > 0))
    is_around = is_below & (down <= SEARCH) & (right > -SEARCH) & (right <= SEARCH)
    points, axes = planes.reshape(3, -1)[:, places], normals.reshape(3, -1)[:, places]
    distance2 = ((points[:, :, np.newaxis] - points[:, np.newaxis]) ** 2).sum(axis=0)
    reach2 = reach2.ravel()[places]
    is_near = (distance2 <= reach2) & (distance2 <= reach2[:, np.newaxis])
    one, other = np.nonzero(is_around & is_near & (np.abs(axes.T @ axes) >= COSINE))
    graph = coo_array((np.ones(len(one)), (one, other)), shape=(len(places), len(places)))
    return np.asarray(connected_components(graph, directed=False)[1])


@pytest.mark.parametrize("seed", range(8))
def test_regions_are_what_hangs_together_by_any_pair_that_joins(seed: int) -> None:
    planes, normals, reach2 = scene(seed)
    rng = np.random.default_rng(seed)
    share = rng.uniform(0.3, 1.0)
    some = np.pad(rng.random((HEIGHT, WIDTH)) < share, MARGIN)
    places = np.flatnonzero(some).astype(np.int32)
    rows, columns = np.nonzero(some)
    part = np.array([rows.min(), columns.min(), rows.max() + 1, columns.max() + 1])
    labels = np.full(reach2.size, NOTHING, np.int32)
    found = join(planes, places, part, normals, reach2.ravel(), COSINE, labels)
    assert (labels == NOTHING).all()
    expected = hang_together(planes, normals, reach2, places)
    pairs = np.unique(np.stack([found, expected]), axis=1)
    assert 10 < pairs.shape[1] < len(places) / 2  # else the test says little
    assert pairs.shape[1] == len(np.unique(found)) == len(np.unique(expected))


@pytest.mark.parametrize("seed", range(4))
def test_a_bent_place_goes_to_a_region_beside_it_and_joins_no_two(seed: int) -> None:
    planes, normals, reach2 = scene(seed)
    rng = np.random.default_rng(seed)
    reach2[rng.random(reach2.shape) < 0.2] *= -1  # what is no point becomes a far one
    some = np.pad(np.ones((HEIGHT, WIDTH), bool), MARGIN)
    places = np.flatnonzero(some).astype(np.int32)
    part = np.array([MARGIN, MARGIN, MARGIN + HEIGHT, MARGIN + WIDTH])
    labels = np.full(reach2.size, NOTHING, np.int32)
    before = reach2.copy()
    found = join(planes, places, part, normals, reach2.ravel(), COSINE, labels)
    np.testing.assert_array_equal(reach2, before)
    is_bent = reach2[some] < 0
    unbent = hang_together(planes, normals, reach2, places[~is_bent])
    assert np.unique(np.stack([found[~is_bent], unbent]), axis=1).shape[1] == unbent.max() + 1

    region_at = dict(zip(places.tolist(), found.tolist(), strict=True))
    points, axes = planes.reshape(3, -1), normals.reshape(3, -1)
    reaches, stride = np.abs(reach2.ravel()), planes.shape[2]
    homeless = 0
    for place in places[is_bent].tolist():
        around = [place + down * stride + right for down in (-1, 0, 1) for right in (-1, 0, 1)]
        near = [
            other
            for other in around
            if other in region_at
            and reach2.ravel()[other] > 0
            and ((points[:, place] - points[:, other]) ** 2).sum()
            <= min(reaches[place], reaches[other])
            and abs(axes[:, place] @ axes[:, other]) >= COSINE
        ]
        if near:
            assert region_at[place] in [region_at[other] for other in near]
        else:
            homeless += 1
            assert np.count_nonzero(found == region_at[place]) == 1
    assert 0 < homeless < np.count_nonzero(is_bent)  # else the test says little
