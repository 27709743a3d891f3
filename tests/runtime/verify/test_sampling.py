"""The verifier's sample: uniform, repeatable by its nonce, and with the stated confidence."""

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st
from recipe_runtime.verify.sampling import Bound, draw, draw_scenes, sample_size
from recipe_runtime.verify.verdict import Difference, Report


@pytest.mark.slow
@given(st.integers(1, 400), st.data())
def test_the_sample_is_a_repeatable_choice_without_replacement(total: int, data: st.DataObject) -> None:
    count, nonce = data.draw(st.integers(1, total)), data.draw(st.integers(0, 2**53 - 1))
    chosen = draw(range(total), count, nonce)
    assert chosen == draw(range(total), count, nonce) == sorted(set(chosen))
    assert len(chosen) == count
    assert set(chosen) <= set(range(total))


def test_every_frame_is_equally_likely() -> None:
    counts = [0] * 13
    for nonce in range(2600):
        for place in draw(range(13), 5, nonce):
            counts[place] += 1
    assert all(abs(count - 1000) < 110 for count in counts)


def test_different_nonces_give_different_samples() -> None:
    assert draw(range(1000), 10, 1) != draw(range(1000), 10, 2)


@pytest.mark.parametrize(("confidence", "bound", "k"), [(0.95, 0.05, 59), (0.95, 0.03, 99), (0.99, 0.01, 459)])
def test_the_rule_of_three(confidence: float, bound: float, k: int) -> None:
    assert sample_size(10_000, confidence, bound) == k
    assert Bound(k, 10_000, confidence).differing <= bound < Bound(k - 1, 10_000, confidence).differing


def test_a_small_dataset_is_compared_in_full() -> None:
    assert sample_size(20, 0.95, 0.05) == 20
    assert Bound(20, 20, 0.95).differing == 0.0
    assert str(Bound(20, 20, 0.95)) == "all 20 frames checked"


@pytest.mark.slow
@pytest.mark.parametrize("bad", [range(4), range(76, 80), (1, 21, 41, 61)])
def test_the_sample_misses_differences_as_rarely_as_stated(bad: Sequence[int]) -> None:
    """If any 5 % of 80 frames differ, a sample of 59 misses all of them in far less than 5 % of runs."""
    missed = sum(not set(bad).intersection(draw(range(80), 59, nonce)) for nonce in range(2000))
    assert missed <= 2000 * 0.05 * 0.5


@pytest.mark.parametrize(
    ("scenes", "drawn", "chosen"), [(3, 1, 3), (64, 1, 64), (65, 1, 64), (500, 59, 64), (90, 80, 80)]
)
def test_scenes_of_drawn_frames_and_others_up_to_a_limit(scenes: int, drawn: int, chosen: int) -> None:
    names = [f"{number:03}" for number in range(scenes)]
    found = draw_scenes(names, set(names[-drawn:]), nonce=7)
    assert len(found) == chosen and found == sorted(found)
    assert set(names[-drawn:]) <= set(found)
    assert found == draw_scenes(names, set(names[-drawn:]), nonce=7)


def test_a_report_separates_differing_files_from_differing_frames() -> None:
    """FAIL with `0 of them differ` would contradict itself."""

    def extent(*differences: Difference) -> str:
        return Report("r", "r@sha256:0", 1, Bound(20, 480, 0.95), list(differences)).extent

    file = Difference("file", "tracks.csv differs", path="tracks.csv")
    assert extent(file) == "20 of 480 frames compared, no rendered frame differs, but 1 file of the dataset does"
    frame = Difference("shading", "it differs", variant="v", sensor="s", frame=3, path="v/s/rgb/000003.png")
    assert extent(frame, file) == "20 of 480 frames compared, 1 of them differs"
    plan = Difference("recipe", "small.yaml differs")
    assert extent(plan) == "20 of 480 frames compared, no rendered frame differs"
