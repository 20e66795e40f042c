"""Calibration on the page: measurements by their declaration, evaluated by REST, told with their figures."""

from __future__ import annotations

from typing import Any

import pytest
from support.live.browser import Site

from controller.calibration.measurements import MEASUREMENTS

pytestmark = pytest.mark.slow
ROWS = [f"{x},{s},{x + 0.001 * n + 0.002 * s}" for n in range(3) for x in (0, 50, 100) for s in (1, -1)]
LASER = "\n".join(["target,sense,measured", *ROWS]).encode()


@pytest.fixture
def calibration(page: Any, site: Site) -> Any:
    site.tell(mode="READY")
    page.evaluate("dx.show('setup')")
    page.click("[data-setup=calibration]")
    page.wait_for_selector("[data-part=calibration] [name=sphere_radius]")
    return page


def test_every_measurement_has_its_values_and_says_what_it_takes(calibration: Any) -> None:
    said = set()
    for name, one in MEASUREMENTS.items():
        calibration.select_option("[name=measurement]", name)
        fields = calibration.eval_on_selector_all(
            ".probing [name]:not([name=program])", "all => all.map((one) => one.name)"
        )
        assert fields == ["measurement", *one.values]
        assert (calibration.query_selector(".probing [name=program]") is None) == (one.program == "no")
        takes_file = calibration.query_selector("[data-part=calibration] input[type=file]") is not None
        assert takes_file == (one.takes in ("touches", "laser"))
        said.add(calibration.inner_text("[data-part=calibration] p.dim"))
    assert len(said) == len(MEASUREMENTS)


def test_an_axis_is_evaluated_with_figures_picture_and_the_file_as_it_would_be(calibration: Any) -> None:
    calibration.select_option("[name=measurement]", "axis")
    calibration.fill("[name=axis]", "X")
    table = {"name": "x.csv", "mimeType": "text/csv", "buffer": LASER}
    calibration.set_input_files("[data-part=calibration] input[type=file]", files=[table])
    calibration.click("#measure-run")
    calibration.wait_for_function("() => document.querySelector('#measure-found img')?.naturalWidth > 0")
    told = calibration.inner_text("#measure-found")
    assert "reversal B\n4\n" in told and "_" not in told.replace("machine_", "")
    with calibration.expect_download() as got:
        calibration.click("#measure-file")
    assert "pitch = " in got.value.path().read_text()


def test_what_is_missing_is_said(calibration: Any) -> None:
    calibration.select_option("[name=measurement]", "circle")
    calibration.select_option("[name=measurement]", "rotaries")
    calibration.click("#measure-run")
    calibration.wait_for_selector("#dx-said:has-text('sphere_radius')")
