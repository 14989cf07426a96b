"""Clearances of a robot on eight cables at random poses: nanoseconds of CPU time a pose of each kernel, and of all."""

import argparse
import time

BATCH, ROUNDS = 65_536, 8


def main() -> None:
    """Print a line for each kernel, then one for whole scenes from arrays to arrays."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--dtype", choices=["float32", "float64"], default="float32")
    options = parser.parse_args()
    import jax
    import numpy as np

    jax.config.update("jax_enable_x64", True)
    from cspr_jax.robots.contacts import clearance
    from cspr_jax.robots.model import shapes
    from cspr_jax.robots.model.platform import platform_robot

    rng, count, signs = np.random.default_rng(0), options.count, (-1.0, 1.0)
    corners = np.array([[x, y, z] for x in signs for y in signs for z in signs])
    robot = platform_robot(corners * [5.0, 4.0, 3.0], corners * [0.4, 0.3, 0.2], mass=1.0, inertia=np.eye(3))
    positions, turns = rng.uniform(-3.0, 3.0, (count, 3)), rng.normal(size=(count, 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    room = {
        "sphere": shapes.sphere([1.0, 1.0, 1.0], 0.3),
        "cylinder": shapes.cylinder([1.0, 2.0, 0.0], [2.0, 2.0, 5.0], 0.2),
        "box": shapes.box([-2.0, 0.0, 0.0], [1.0, 0.5, 2.0], [0.6, 0.8, 0.0, 0.0]),
    }
    bodies = {"platform's box": shapes.box([0.0, 0.0, 0.0], [0.8, 0.6, 0.4]), "hull": clearance.attachment_hull(robot)}
    dtype = np.dtype(options.dtype)
    some = min(count, BATCH)
    poses = clearance.kernels.PoseLanes(
        tuple(positions[:some].T.astype(dtype)), tuple(turns[:some].T.astype(dtype)), None
    )

    def cpu(function, rounds: int) -> float:
        function()
        least = np.inf
        for _ in range(3):
            began = time.process_time()
            for _ in range(rounds):
                function()
            least = min(least, (time.process_time() - began) / rounds)
        return least

    for name, body in bodies.items():
        scene = clearance.scene(robot, diameter=0.01, obstacles=list(room.values()), body=body)
        terms = list(clearance._terms(scene, np.zeros(3), dtype))
        for kind, first, term in terms:
            meeting = scene.contact_pairs[first]
            what = f"{kind} {list(room)[meeting.other]}" if "obstacle" in kind else kind
            seconds = cpu(lambda term=term: jax.block_until_ready(term(poses)), ROUNDS)
            print(f"{what:28s} {1e9 * seconds / some:8.1f} ns a pose")
        seconds = cpu(lambda scene=scene: clearance.clearances(scene, positions, turns, dtype=options.dtype), 1)
        print(f"all, with the {name:14s} {1e9 * seconds / count:8.1f} ns a pose, {count} poses")


if __name__ == "__main__":
    main()
