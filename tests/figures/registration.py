"""Measure the registration: ``python -m tests.figures.registration --pairs 300 --peers 60 --free 120``.

Prints, over generated pairs, the errors, the share of true motions inside the stated 95 % region,
refusals, CPU time, other methods beside it on the same pairs, and the Cramér–Rao bound for shifts.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator

import cv2
import numpy as np
from scipy.ndimage import shift as translate
from scipy.stats import chi2

from imclab.registration import register
from tests.registration_pairs import BANDS, SNR_DB, TARGETS, Pair, decoy_frames, make_pair

Method = Callable[[Pair], "np.ndarray | None"]


def pairs(count: int, first: int = 0) -> Iterator[Pair]:
    """Every band in turn, with noise, target and polarity going round at other paces."""
    for k in range(count):
        seed = first + k // len(BANDS)
        yield make_pair(
            seed,
            band=BANDS[k % len(BANDS)],
            snr_db=SNR_DB[(seed + k) % len(SNR_DB)],
            target=TARGETS[(seed + k // 5 + k) % len(TARGETS)],
            dark=seed % 4 == 3,
        )


def measure_ours(count: int, first: int) -> None:
    rows = []
    for pair in pairs(count, first):
        begin = time.process_time()
        found = register(pair.fixed, pair.moving, model=pair.model)
        spent = time.process_time() - begin
        inside = (
            found.squared_distance(pair.matrix) <= chi2.ppf(0.95, len(found.covariance)) if found.ok else True
        )
        error, target = pair.corner_error(found.matrix), pair.target_error(found.matrix)
        wrong = found.ok and error > max(5.0, 4 * found.stderr_px)
        rows.append((error, target, spent, found.ok, inside, wrong, found.quality, found.contrast))
        if wrong or not found.ok or error > 5:
            print(
                f"  {pair.band} {pair.snr_db:g} dB {pair.target}: {error:.2f} px, "
                f"stated {found.stderr_px:.2f}, {found.reason}"
            )
    data = np.array(rows, dtype=float)
    labels = [(p.snr_db, p.band, p.target) for p in pairs_labels(count, first)]
    line("all", data)
    for axis in range(3):
        for value in dict.fromkeys(label[axis] for label in labels):
            line(str(value), data[[label[axis] == value for label in labels]])


def pairs_labels(count: int, first: int) -> list[Pair]:
    """The labels of :func:`pairs` alone, without drawing."""
    empty = np.empty((0, 0))
    out = []
    for k in range(count):
        seed = first + k // len(BANDS)
        target = TARGETS[(seed + k // 5 + k) % len(TARGETS)]
        out.append(
            Pair(empty, empty, empty, empty, target, BANDS[k % len(BANDS)], SNR_DB[(seed + k) % len(SNR_DB)])
        )
    return out


def line(name: str, data: np.ndarray) -> None:
    error, target, spent, ok, inside, wrong, quality, contrast = data.T
    parts = [
        f"{name:>11} n {len(error):4d}",
        f"corner median {np.median(error):.3f} p95 {np.quantile(error, 0.95):.2f} max {error.max():.2f}",
        f"fail {np.sum(~(error < 5)):d}",
        f"target median {np.median(target):.3f} p95 {np.quantile(target, 0.95):.3f}",
        f"refused {np.sum(ok == 0):d} confident and wrong {np.sum(wrong):.0f}",
        f"inside {inside.mean():.3f}",
        f"CPU {np.median(spent):.2f} s",
        f"least quality {quality.min():.2f} contrast {contrast.min():.0f}",
    ]
    print(" | ".join(parts), flush=True)


def measure_free(count: int, first: int) -> None:
    accepted, total = {}, {}
    for seed in range(first, first + count):
        pair = make_pair(seed, band="small", target=TARGETS[seed % 4])
        for kind, frame in decoy_frames(seed).items():
            found = register(pair.fixed, frame, model=("similarity", "affine", "homography")[seed % 3])
            accepted[kind] = accepted.get(kind, 0) + found.ok
            total[kind] = total.get(kind, 0) + 1
            if found.ok:
                print(
                    f"  accepted: {kind} {seed}, quality {found.quality:.2f}, contrast {found.contrast:.0f}"
                )
    told = ", ".join(f"{kind} {accepted[kind]} of {total[kind]}" for kind in total)
    print("target-free frames accepted:", told, flush=True)


def measure_peers(count: int, first: int) -> None:
    methods: dict[str, Method] = {
        "imclab": lambda pair: register(pair.fixed, pair.moving, model=pair.model).matrix,
        "grid + ECC, masked": grid_ecc,
        "findTransformECC": plain_ecc,
        "phase correlation": phase,
        "ORB + RANSAC": lambda pair: features(pair, cv2.ORB_create(2000)),
        "SIFT + RANSAC": lambda pair: features(pair, cv2.SIFT_create()),
    }
    try:
        import SimpleITK  # noqa: F401

        methods["SimpleITK correlation"] = simple_itk
    except ImportError:
        print("SimpleITK is not installed: left out")
    for name, method in methods.items():
        errors, targets, spent = [], [], []
        for pair in pairs(count, first):
            begin = time.process_time()
            try:
                matrix = method(pair)
            except cv2.error:
                matrix = None
            spent.append(time.process_time() - begin)
            good = matrix is not None and np.isfinite(matrix).all()
            errors.append(pair.corner_error(matrix) if good else np.inf)
            targets.append(pair.target_error(matrix) if good else np.inf)
        fail = np.mean(~(np.array(errors) < 5))
        print(
            f"{name:>22}: corner median {np.median(errors):8.2f} "
            f"p95 {np.quantile(errors, 0.95, method='higher'):8.1f} "
            f"target median {np.median(targets):7.2f} fail {100 * fail:3.0f} % "
            f"CPU {1e3 * np.median(spent):5.0f} ms",
            flush=True,
        )


def unit(picture: np.ndarray) -> np.ndarray:
    """Hot pixels removed, background taken off, unit range."""
    clean = cv2.medianBlur(np.asarray(picture, np.float32), 3)
    flat = clean - cv2.GaussianBlur(clean, (0, 0), 40)
    return np.asarray((flat - flat.min()) / np.ptp(flat), np.float32)


def centred(pair: Pair) -> np.ndarray:
    gap = (np.array(pair.moving.shape) - np.array(pair.fixed.shape)) / 2
    return np.array([[1, 0, gap[1]], [0, 1, gap[0]], [0, 0, 1]], np.float32)


def ecc(pair: Pair, start: np.ndarray, mask: np.ndarray | None) -> np.ndarray:
    kind = cv2.MOTION_HOMOGRAPHY if pair.model == "homography" else cv2.MOTION_AFFINE
    warp = np.asarray(start if pair.model == "homography" else start[:2], np.float32)
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-6)
    fixed, moving = unit(pair.fixed), unit(pair.moving)
    if mask is None:
        _, warp = cv2.findTransformECC(fixed, moving, warp, kind, stop, None, 5)
    else:
        everywhere = np.full(moving.shape, 255, np.uint8)
        _, warp = cv2.findTransformECCWithMask(fixed, moving, mask, everywhere, warp, kind, stop, 7)
    return np.asarray(warp if len(warp) == 3 else np.vstack([warp, [0, 0, 1]]), float)


def plain_ecc(pair: Pair) -> np.ndarray:
    return ecc(pair, centred(pair), None)


def grid_ecc(pair: Pair) -> np.ndarray:
    from imclab.registration.coarse import candidates
    from imclab.registration.reference import prepare

    reference = prepare(pair.fixed)
    assert reference is not None
    start = candidates(reference, np.asarray(pair.moving, float), count=1)[0].matrix
    mask = np.where(reference.distance < 14, 255, 0).astype(np.uint8)
    mask[:5] = mask[-5:] = 0
    mask[:, :5] = mask[:, -5:] = 0
    return ecc(pair, np.asarray(start, np.float32), mask)


def phase(pair: Pair) -> np.ndarray:
    rows, cols = np.maximum(pair.fixed.shape, pair.moving.shape)
    padded = [np.zeros((rows, cols), np.float32) for _ in range(2)]
    for field, picture in zip(padded, (pair.fixed, pair.moving), strict=True):
        field[: picture.shape[0], : picture.shape[1]] = unit(picture)
    (x, y), _ = cv2.phaseCorrelate(*padded)
    return np.array([[1, 0, x], [0, 1, y], [0, 0, 1.0]])


def features(pair: Pair, detector: object) -> np.ndarray | None:
    found = [
        detector.detectAndCompute((255 * unit(picture)).astype(np.uint8), None)
        for picture in (pair.fixed, pair.moving)
    ]
    if any(descriptors is None or len(descriptors) < 4 for _, descriptors in found):
        return None
    norm = cv2.NORM_HAMMING if found[0][1].dtype == np.uint8 else cv2.NORM_L2
    matches = cv2.BFMatcher(norm, crossCheck=True).match(found[0][1], found[1][1])
    if len(matches) < 4:
        return None
    here = np.float32([found[0][0][m.queryIdx].pt for m in matches])
    there = np.float32([found[1][0][m.trainIdx].pt for m in matches])
    if pair.model == "homography":
        return cv2.findHomography(here, there, cv2.RANSAC, 3.0)[0]
    estimate = cv2.estimateAffine2D if pair.model == "affine" else cv2.estimateAffinePartial2D
    matrix = estimate(here, there, ransacReprojThreshold=3.0)[0]
    return None if matrix is None else np.vstack([matrix, [0, 0, 1]])


def simple_itk(pair: Pair) -> np.ndarray | None:
    import SimpleITK as sitk  # noqa: N813

    fixed, moving = (sitk.GetImageFromArray(unit(picture)) for picture in (pair.fixed, pair.moving))
    kind = sitk.Similarity2DTransform() if pair.model == "similarity" else sitk.AffineTransform(2)
    start = sitk.CenteredTransformInitializer(
        fixed, moving, kind, sitk.CenteredTransformInitializerFilter.GEOMETRY
    )
    method = sitk.ImageRegistrationMethod()
    method.SetMetricAsCorrelation()
    method.SetOptimizerAsRegularStepGradientDescent(1.0, 1e-4, 200)
    method.SetOptimizerScalesFromPhysicalShift()
    method.SetShrinkFactorsPerLevel([4, 2, 1])
    method.SetSmoothingSigmasPerLevel([4, 2, 1])
    method.SetInitialTransform(start, inPlace=False)
    try:
        found = method.Execute(fixed, moving)
    except RuntimeError:
        return None
    corners = np.float32([[0, 0], [100, 0], [0, 100]])
    there = np.float32([found.TransformPoint([float(x), float(y)]) for x, y in corners])
    return np.vstack([cv2.getAffineTransform(corners, there), [0, 0, 1]])


def measure_shifts() -> None:
    """Pure shifts under white noise: error of each axis beside the Cramér–Rao bound."""
    for snr_db in (40, 20, 10, 0):
        errors, stated, bound = [], [], 0.0
        for seed in range(12):
            rng = np.random.default_rng([seed, snr_db])
            pair = make_pair(seed, target=TARGETS[seed % 4])
            soft = cv2.GaussianBlur(pair.fixed, (0, 0), 1.5)
            shift = rng.uniform(-5, 5, 2)
            moved = translate(soft, shift[::-1], order=5, mode="nearest")  # cv2's cubic moves a ramp wrongly
            level = soft.std() / 10 ** (snr_db / 20)
            slope = np.gradient(soft)
            bound += np.mean([level**2 / np.sum(part**2) for part in slope]) / 12
            found = register(soft, moved + rng.normal(0, level, soft.shape), model="translation")
            errors.append(found.matrix[:2, 2] - shift)
            stated.append(found.stderr_px / np.sqrt(2))
        rms = float(np.sqrt(np.mean(np.square(errors))))
        print(
            f"shift at {snr_db:2d} dB: rms error {rms:.4f} px, bound {np.sqrt(bound):.4f}, "
            f"stated {np.mean(stated):.4f}",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    for name, default in (("pairs", 300), ("peers", 60), ("free", 40), ("first", 1000)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--shifts", action=argparse.BooleanOptionalAction, default=True)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    register(*(make_pair(0).fixed,) * 2)  # compile before timing
    if options.pairs:
        measure_ours(options.pairs, options.first)
    if options.free:
        measure_free(options.free, options.first)
    if options.peers:
        measure_peers(options.peers, options.first)
    if options.shifts:
        measure_shifts()


if __name__ == "__main__":
    main()
