"""A few lines that stand for billions of values are refused before any of them is made."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from omegaconf import OmegaConf
from omegaconf.errors import InterpolationResolutionError

from pipeline.common.errors import ConfigError
from pipeline.config import unfolding
from pipeline.config.compose import checked
from pipeline.config.unfolding import MOST_VALUES, TooMany, bound_files, bounded
from tests.commands import assert_refused, call

DOUBLED = "\n".join(["x0: &x0 [1, 1]", *(f"x{i}: &x{i} [*x{i - 1}, *x{i - 1}]" for i in range(1, 31))])
MERGED = "\n".join(["x0: &x0 {a: 1}", *(f"x{i}: &x{i} {{<<: [*x{i - 1}, *x{i - 1}]}}" for i in range(1, 31))])
CHAIN = {"name": "${x30}", "x0": "a", **{f"x{i}": f"${{x{i - 1}}}${{x{i - 1}}}" for i in range(1, 31)}}
LISTS = {"x0": ["a"], **{f"x{i}": [f"${{x{i - 1}}}"] * 2 for i in range(1, 31)}}


@pytest.fixture(autouse=True)
def _files() -> Iterator[None]:
    before = yaml.SafeLoader.compose_node
    bound_files()
    yield
    yaml.SafeLoader.compose_node = before


@pytest.mark.parametrize("text", [DOUBLED, MERGED])
def test_aliases_of_aliases(text: str) -> None:
    with pytest.raises(TooMany, match=rf"more than {MOST_VALUES} values(?s:.)*line"):
        OmegaConf.create(text)


def test_every_alias_counts_what_it_stands_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unfolding, "MOST_VALUES", 11)
    assert yaml.safe_load("[&a [1, 2], *a, *a, 3]") == [[1, 2], [1, 2], [1, 2], 3]  # 1 + 3 * 3 + 1 values
    with pytest.raises(TooMany):
        yaml.safe_load("[&a [1, 2], *a, *a, 3, 4]")
    assert yaml.safe_load("{a: {b: 1}, c: [1, 2]}") == {"a": {"b": 1}, "c": [1, 2]}  # and keys count: 9


def test_an_anchor_that_holds_itself() -> None:
    with pytest.raises(TooMany, match="an anchor that holds itself"):
        yaml.safe_load("a: &a [*a]")


@pytest.mark.parametrize("values", [CHAIN, LISTS])
def test_interpolations_of_interpolations(values: dict[str, object], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unfolding, "MOST_RESOLVED", 100)  # so that there is less to wait for
    with pytest.raises(ConfigError, match="more than 100 interpolations"):
        checked(OmegaConf.create(values))


def test_values_apart_are_counted_apart_unless_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unfolding, "MOST_RESOLVED", 2)
    values = OmegaConf.create({"a": 1, "b": "${a}", "c": "${b}", "d": "${c}", "e": ["${a}", "${c}"]})
    with bounded():
        assert (values.b, values.c, values.c) == (1, 1, 1)
        with pytest.raises(InterpolationResolutionError):
            _ = values.d
    with bounded(together=True):
        assert values.c == 1
        with pytest.raises(InterpolationResolutionError):
            _ = values.b
    assert values.d == 1


def test_a_folder_of_configurations(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "many.yaml").write_text(f"# @package _global_\n{DOUBLED}\n")
    answer = call(monkeypatch, capfd, "--config-dir", str(tmp_path), "+experiment=many")
    assert_refused(answer, "more than 10000 values", "many.yaml", "line")
    assert [file.name for file in tmp_path.iterdir()] == ["experiment"]
