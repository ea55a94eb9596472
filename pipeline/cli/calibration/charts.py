"""The MTF of a camera from pictures of a chart, slanted edges or a Siemens star, for ``camera-monitor calibrate``.

Measuring is that of `pipeline.camera.characterisation.slanted_edge` and `pipeline.camera.characterisation.star`; here
pictures that do not show such a chart are refused, in the words of the command's options.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

LEAST_MTF = 0.05  # an MTF is not stored below this: it is noise there
MOST_ERROR = 0.05  # standard error of a value of the MTF
CIRCLES = (1.0, 0.75, 0.5)  # on which the rays of a star are counted, of the circle of its lowest frequency
LEAST_EXPLAINED = 0.5  # of the variance along each of them; of black and white rays it is 0.8, of other pictures < 0.25
LEAST_AGREEMENT = 0.7  # correlation of the rays on neighbouring circles
MOST_WITHOUT_SHARPENING = 1.05  # an MTF above it is told
LEAST_STAR_AMPLITUDE = 0.02  # of the rays at the lowest frequency, of full scale


def edge_mtf(
    frames: list[tuple[str, NDArray[np.float32]]], areas: tuple[tuple[int, int, int, int], ...]
) -> NDArray[np.float64]:
    """(2, 8) MTF from slanted edges as measured, the mean of those of each axis; above 1 where the camera sharpens.

    Warns of edges tilted so far that it is right for round blur only.

    Args:
        frames: names and pictures (H, W) in [0, 1].
        areas: (x, y, width, height) px of the edges in every picture; none for the whole picture.

    Raises:
        InputError: an area outside of a picture, no slanted edge, one clipped at black or white, none of one axis, or
            edges too faint, too noisy or too short (`MOST_ERROR`).
    """
    import click
    import numpy as np

    from pipeline.camera.characterisation.slanted_edge import ROUND_BLUR_TILT_DEG, EdgeMtf, measure
    from pipeline.camera.mtf import DIRECTIONS
    from pipeline.errors import InputError

    edges: dict[str, list[EdgeMtf]] = {direction: [] for direction in DIRECTIONS}
    for name, image in frames:
        for x, y, width, height in areas or [(0, 0, image.shape[1], image.shape[0])]:
            if x + width > image.shape[1] or y + height > image.shape[0]:
                raise InputError(f"--area {x},{y},{width},{height} is not inside of {name}")
            try:
                edge = measure(image[y : y + height, x : x + width])
            except InputError as error:
                raise InputError(f"{name}: {error}") from None
            edges[edge.direction].append(edge)
            if edge.tilt_deg > ROUND_BLUR_TILT_DEG:
                click.echo(
                    f"warning: {name}: edge: tilted by {edge.tilt_deg:.0f} degrees; beyond {ROUND_BLUR_TILT_DEG:g} its "
                    f"{edge.direction} MTF is right for round blur only, not behind motion; tilt it by about 5 degrees",
                    err=True,
                )
    for direction, tilt in zip(DIRECTIONS, ("vertical", "horizontal"), strict=True):
        if not edges[direction]:
            raise InputError(f"no nearly {tilt} edge, which gives the {direction} MTF; add one by a picture or --area")
    curves, errors = (
        [np.array([getattr(edge, name) for edge in edges[direction]]) for direction in DIRECTIONS]
        for name in ("mtf", "error")
    )
    _refuse_noisy("edge", errors, "take longer edges, of more contrast, or more pictures of them")
    return np.stack([curve.mean(axis=0) for curve in curves])


def storable(mtf: NDArray[np.float64]) -> NDArray[np.float64]:
    """The MTF of a chart as estimates are divided by it, `LEAST_MTF` to 1; warns of overshoot.

    Estimates end at 1 and see little of sharpening: those of KITTI and Penn-Fudan frames behind a disc of 3 px, then an
    unsharp mask of 1 px and amount 1, lie .04 from the MTF of the disc; divided by the mask's they lie .15 from it, and
    the camera's own sharp frames would look blurred.

    Args:
        mtf: (2, 8) as measured.
    """
    import click
    import numpy as np

    if mtf.max() > MOST_WITHOUT_SHARPENING:
        click.echo(
            f"warning: overshoot to {mtf.max():.2f}: the camera sharpens; stored as 1.00 where the MTF is above, since "
            "estimates end there",
            err=True,
        )
    return np.clip(mtf, LEAST_MTF, 1.0)


def _refuse_noisy(subject: str, errors: list[NDArray[np.float64]], mend: str) -> None:
    """Raises InputError where noise of the pictures makes an MTF unsure.

    Args:
        subject: edge or star.
        errors: of both axes, (N, 8) standard errors of the MTF in N edges or pictures, of which the mean is stored.
        mend: what to do.
    """
    import numpy as np

    from pipeline.camera.mtf import DIRECTIONS, FREQUENCIES
    from pipeline.errors import InputError

    for direction, error in zip(DIRECTIONS, errors, strict=True):
        of_mean = np.sqrt(np.square(error).sum(axis=0)) / len(error)
        if of_mean.max() > MOST_ERROR:
            raise InputError(
                f"--chart {subject}: the {direction} MTF is too noisy: standard error {of_mean.max():.2f} at "
                f"{FREQUENCIES[of_mean.argmax()]:.2f} of Nyquist, expected at most {MOST_ERROR:g}; {mend}"
            )


def star_mtf(frames: list[tuple[str, NDArray[np.float32]]], rays: int) -> NDArray[np.float64]:
    """(2, 8) MTF from Siemens stars as measured, relative to its lowest frequency, the mean over pictures.

    Args:
        frames: names and pictures (H, W) in [0, 1].
        rays: bright rays in a full turn, an even number, which makes the star point-symmetric.

    Raises:
        InputError: an odd or too small number of rays, a star too small for the lowest frequency, with too little
            contrast or too much noise (`MOST_ERROR`), clipped at black or white, or with another number of rays, or no
            star.
    """
    import numpy as np

    from pipeline.camera.characterisation import star
    from pipeline.camera.characterisation.star_centre import point_of_symmetry
    from pipeline.errors import InputError

    if rays % 2:
        raise InputError(f"--rays {rays}: expected an even number, whose centre can be located by symmetry")
    if rays < star.LEAST_PERIODS:
        raise InputError(
            f"--rays {rays}: expected at least {star.LEAST_PERIODS}; fewer are too coarse for the highest frequency "
            "but a few pixels from the centre; use a star of more rays"
        )
    curves, errors = [], []
    for name, image in frames:
        try:
            centre_px = point_of_symmetry(image)
        except InputError as error:
            raise InputError(f"{name}: {error}") from None
        _check_star(name, image, centre_px, rays)
        try:
            star.check_clipping(image, centre_px, rays)
        except InputError as error:
            raise InputError(f"{name}: {error}") from None
        contrast, uncertain = star.measure_mtf_with_error(image, centre_px, rays, amplitude=1.0)
        if contrast[:, 0].min() < LEAST_STAR_AMPLITUDE:
            raise InputError(
                f"{name}: the rays of the star differ by {510 * contrast[:, 0].min():.0f} DN; expected at least "
                f"{510 * LEAST_STAR_AMPLITUDE:.0f}; light the chart better or expose longer"
            )
        curve = contrast / contrast[:, :1]
        curves.append(curve)
        relative = np.hypot(uncertain, curve * uncertain[:, :1]) / contrast[:, :1]
        errors.append(np.where(np.arange(relative.shape[1]) > 0, relative, 0.0))  # exactly 1 at the lowest frequency
    of_axes = list(np.swapaxes(errors, 0, 1))
    _refuse_noisy("star", of_axes, "light the chart better, expose longer, or take more pictures of it")
    return np.asarray(np.mean(curves, axis=0))


def _check_star(name: str, image: NDArray[np.float32], centre_px: tuple[float, float], rays: int) -> None:
    """Raises InputError unless a picture shows a Siemens star of that number of rays, large enough."""
    import numpy as np

    from pipeline.camera.characterisation import star
    from pipeline.errors import InputError

    radius_px = star.lowest_circle_px(rays)
    x, y = centre_px
    room_px = min(x, y, image.shape[1] - 1 - x, image.shape[0] - 1 - y)
    larger = f"a star of {rays} rays must be {2 * radius_px:.0f} px across"
    mend = "check --rays, take the whole star from nearer by, or use one of fewer rays"
    if room_px < radius_px:
        raise InputError(
            f"{name}: {larger}, but the picture ends {room_px:.0f} px from its centre ({x:.0f}, {y:.0f}); {mend}"
        )
    evidence = star.ray_evidence(image, centre_px, rays, radius_px * np.array(CIRCLES))
    present = (evidence.explained >= LEAST_EXPLAINED) & (evidence.extra_rays == 0)
    if present.all() and evidence.agreement.min() >= LEAST_AGREEMENT:
        return
    if present[-1] and not present[0]:
        raise InputError(f"{name}: {larger}, but its rays end before that; {mend}")
    if (
        evidence.explained.min() >= LEAST_EXPLAINED and (evidence.extra_rays % 2).any()
    ):  # where there are none they turn
        likely = "they do not go all the way round, part of it is hidden or without contrast"
    elif evidence.explained.min() >= LEAST_EXPLAINED and len(set(evidence.extra_rays.tolist())) == 1:
        likely = f"the star seems to have {rays + int(evidence.extra_rays[0])} rays"
    elif evidence.likely_explained >= LEAST_EXPLAINED:
        likely = f"the star seems to have about {evidence.likely_rays} rays"
    else:
        percent = ", ".join(f"{100 * value:.0f}" for value in evidence.explained)
        likely = f"such rays explain {percent} % of the variance along three circles about ({x:.0f}, {y:.0f})"
    raise InputError(
        f"{name}: no Siemens star of {rays} rays: {likely}; expected the bright rays in a full turn, of a star that "
        "fills the picture; check --rays and the picture"
    )
