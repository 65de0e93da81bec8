"""What is known to be missed is no news."""

from blind.judge.check import as_published, missed_beyond_chance


def mark(value: float, n: int = 8, reached: bool = False) -> dict:
    estimate = {"value": value, "low": 0.0, "high": 1.0, "n": n}
    return {
        "rig": "virtual_rig",
        "name": "claims",
        "measure": "within",
        "goal": 0.9,
        "at_least": True,
        "reached": reached,
        "estimate": estimate,
    }


def test_a_share_is_held_against_what_the_whole_benchmark_has() -> None:
    few = mark(0.375)
    assert missed_beyond_chance(few, 37)
    (known,) = as_published([few], [mark(0.8, 60)])
    assert known["goal"] == 0.8
    assert not missed_beyond_chance(known, 37)
    (worse,) = as_published([mark(0.125)], [mark(0.8, 60)])
    assert missed_beyond_chance(worse, 37)
    assert as_published([few], [mark(0.95, 60, reached=True)]) == [few]
