"""Smallest values of functions with kinks, from samples of which some do not count."""

import numpy as np
import pytest

from cspr_jax.numerics.search.minima import followed, lowest_samples, narrowed_times, vertex_values

DEPTHS = np.array([0.3, 0.2, 0.25, 0.1, 0.28, 0.27, 0.26, 0.15])
KINKS = (np.arange(len(DEPTHS)) + 0.37) / len(DEPTHS)


def kinked(tau):
    """Two functions of tau (n, m): one with many kinks, and a parabola."""
    kinks = np.min(DEPTHS + 3.0 * np.abs(tau[..., None] - KINKS), axis=-1)
    return np.stack([kinks, (tau - 0.123) ** 2], axis=-1)


def test_the_smallest_sample_is_followed_whatever_others_promise():
    """Samples at far edges of blocks promise more, by parabolas across what does not count, than the lowest kink."""
    edges = np.concatenate([np.linspace(kink - 0.01, kink + 0.013, 5) for kink in KINKS])
    tau = np.sort(np.concatenate([edges, 0.5 * (edges[5::5] + edges[4:-1:5])]))
    values = kinked(tau[None])[0]
    counts = np.isin(tau, edges)
    for masked, starts in ((values, 1), (np.where(counts[:, None], values, np.inf), 2)):
        chosen = lowest_samples(masked, vertex_values(tau, masked), starts)
        smallest, when = followed(kinked, tau[None], chosen[None], rounds=7, n_followed=1)
        np.testing.assert_allclose(smallest[0, 0], DEPTHS.min(), atol=1e-6)
        np.testing.assert_allclose(when[0, 0], KINKS[DEPTHS.argmin()], atol=1e-6)
    np.testing.assert_allclose([smallest[0, 1], when[0, 1]], [0.0, 0.123], atol=1e-6)


def test_the_smallest_sample_comes_first():
    """Whatever others promise, which follow by what they promise."""
    rng = np.random.default_rng(3)
    values = rng.uniform(size=(5, 40, 2))
    estimates = values - rng.exponential(size=values.shape)
    for count in (1, 3):
        chosen = lowest_samples(values, estimates, count)
        np.testing.assert_array_equal(chosen[:, 0], values.argmin(1))
        others = np.take_along_axis(estimates, chosen[:, 1:], axis=1)
        assert (np.diff(others, axis=1) >= 0.0).all()


def test_parabolas_do_not_reach_across_what_does_not_count():
    tau = np.array([0.0, 0.01, 0.5, 1.0])
    values = np.array([1.0, 0.9, np.inf, 0.95])[:, None]
    np.testing.assert_array_equal(vertex_values(tau, values), values)


def test_a_start_that_may_become_the_best_is_followed():
    """A bowl is lower at first than the samples beside a steep kink, which falls below it between them."""
    kink = 0.7 + 0.1 * 0.44 / 8

    def bowl_and_kink(tau):
        return np.minimum((tau - 0.3) ** 2, 5.0 * np.abs(tau - kink) - 0.01)[..., None]

    tau = np.linspace(0.0, 1.0, 11)
    chosen = np.array([[[3], [7]]])
    smallest, when = followed(bowl_and_kink, tau[None], chosen, rounds=7, n_followed=2)
    np.testing.assert_allclose([smallest[0, 0], when[0, 0]], [-0.01, kink], atol=1e-6)


def test_starts_that_cannot_become_the_best_are_given_up():
    """Of waves and kinks of two heights; starts of nearly equal values are followed to their ends."""
    rng = np.random.default_rng(8)
    tau = np.linspace(0.0, 1.0, 41)
    dense = np.linspace(0.0, 1.0, 400_001)
    counts, last_counts = [], []
    for _ in range(60):
        phase, height, frequency, kinks = (
            rng.uniform(0.0, 6.0),
            rng.uniform(0.0, 0.3),
            rng.uniform(9, 40),
            rng.random(9),
        )

        def waves(times, phase=phase, height=height, frequency=frequency, kinks=kinks):
            counts.append(len(np.unique(times)))
            wave = np.cos(frequency * times + phase) + height * times
            return np.stack([wave, np.abs(times[..., None] - kinks).min(-1) * (1.0 + wave) + wave], axis=-1)

        values = waves(tau[None])
        truth = waves(dense[None])[0].min(0)
        counts.clear()
        smallest, _ = narrowed_times(waves, tau, values)
        assert (smallest[0] <= truth + 1e-5).all()
        last_counts.append(counts[-1])
    assert np.mean(last_counts) < 17 * 3


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_smallest_sample_between_others_of_its_place_is_followed(side):
    """At a joint lie samples on both sides, and another where an edge of a block misses the joint by rounding."""
    joint, lowest = 0.6, 0.6 + 0.07 * side

    def jumping(tau):
        return np.where(side * (tau - joint) >= 0.0, (tau - lowest) ** 2, 1.0)[..., None]

    eps = np.spacing(joint)
    tau = np.array([0.0, 0.2, 0.4, joint - eps, joint, joint + eps, 0.8, 1.0])
    values = jumping(tau[None])[0]
    starts = np.full((1, 1, 1), 4)
    assert values[4] <= values.min() + 1e-12
    smallest, when = followed(jumping, tau[None], starts, rounds=7)
    np.testing.assert_allclose([smallest[0, 0], when[0, 0]], [0.0, lowest], atol=1e-6)


def test_what_is_not_a_number_stays():
    tau = np.linspace(0.0, 1.0, 9)
    values = np.where(tau == 0.5, np.nan, tau)[:, None]
    starts = lowest_samples(values, vertex_values(tau, values), 2)
    smallest, when = followed(
        lambda points: np.where(points == 0.5, np.nan, points)[..., None], tau[None], starts[None], 3
    )
    assert np.isnan(smallest[0, 0]) and when[0, 0] == 0.5
