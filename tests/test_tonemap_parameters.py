"""Stage 5: every parameter of every operator, its range, its documentation, what is refused."""

import inspect
import re
import warnings

import numpy as np
import pytest

from hdr_helpers.lab.scenes import chapel_scene
from hdr_helpers.tonemap import OPERATORS, RANGES, check_parameters, tonemap

PARAMETERS = [
    (operator, parameter.name, parameter.default)
    for operator, function in sorted(OPERATORS.items())
    for parameter in list(inspect.signature(function).parameters.values())[1:]
]
every_parameter = pytest.mark.parametrize(
    "operator, name, default", PARAMETERS, ids=[f"{o}-{n}" for o, n, _ in PARAMETERS]
)


@pytest.fixture(scope="module")
def radiance():
    return chapel_scene()[100:220, 200:360]


@every_parameter
def test_every_parameter_changes_the_picture(radiance, operator, name, default):
    changed = tonemap(radiance, operator, **{name: 0.7 * (default or 0) or 0.5})
    assert np.abs(changed - tonemap(radiance, operator)).max() > 0.01


@every_parameter
def test_every_parameter_is_documented_with_its_range_which_holds_its_default(operator, name, default):
    least, most = RANGES[name]
    text = re.search(rf"^{name} : (.*)$", inspect.getdoc(OPERATORS[operator]), re.M).group(1)
    assert text.startswith(f"{least:g} or more;" if most == np.inf else f"{least:g}..{most:g};".replace("1e+06", "1e6"))
    assert default is None or least <= default <= most


@every_parameter
def test_every_parameter_makes_a_picture_at_the_ends_of_its_range_and_is_refused_beyond(
    radiance, operator, name, default
):
    ends = RANGES[name]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for value in ends:
            ldr = tonemap(radiance, operator, **{name: value})
            assert ldr.min() >= 0 and ldr.max() <= 1
    beyond = [np.nan, -np.inf, ends[0] - 0.001, "much", [1, 2], True + 0j]
    for value in beyond + ([ends[1] + 0.001] if ends[1] < np.inf else []):
        with pytest.raises(ValueError) as problem:
            tonemap(radiance, operator, **{name: value})
        said = str(problem.value)
        assert all(part in said for part in (name, operator, f"{ends[0]:g} to {ends[1]:g}", repr(value)))


def test_a_parameter_that_the_operator_lacks_is_refused_with_those_it_has(radiance):
    with pytest.raises(ValueError, match=r"drago has no parameter 'contrast'; it has gamma, saturation, bias\."):
        tonemap(radiance, "drago", contrast=30)


@pytest.mark.parametrize("operator", sorted(OPERATORS))
def test_more_gamma_brightens(radiance, operator):
    assert tonemap(radiance, operator, gamma=2.6).mean() > tonemap(radiance, operator, gamma=1.8).mean() + 0.01


@pytest.mark.parametrize("operator, parameter, less, more", [
    ("gamma", "stops", -1, 3), ("reinhard", "intensity", -2, 3), ("reinhard_global", "key", 0.09, 0.36),
    ("reinhard_global", "white", 5, 0.5), ("drago", "bias", 0.95, 0.75), ("mantiuk", "scale", 0.9, 0.5),
    ("durand", "contrast", 300, 10),
])  # fmt: skip
def test_a_parameter_brightens_the_way_its_docstring_says(radiance, operator, parameter, less, more):
    darker, brighter = (tonemap(radiance, operator, **{parameter: value}).mean() for value in (less, more))
    assert brighter > darker + 0.02


@pytest.mark.parametrize("operator", ["reinhard_global", "drago", "mantiuk", "durand"])
def test_more_saturation_is_more_colourful_and_none_is_grey(radiance, operator):
    grey, some, much = (tonemap(radiance, operator, saturation=value) for value in (0, 0.6, 1.2))
    assert np.ptp(grey, axis=2).max() < 1e-5
    assert np.ptp(some, axis=2).mean() < np.ptp(much, axis=2).mean() - 0.02


def test_an_unknown_operator_is_refused_by_a_check_of_its_parameters_alone():
    with pytest.raises(ValueError, match=r"'glow'.*durand, gamma"):
        check_parameters("glow", {})
