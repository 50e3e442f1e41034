"""Every notebook in a real JupyterLab: it runs to its end, explorers answer the keyboard, no page reports an error."""

import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import pytest

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: the browser extra")
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
if BROWSER is None:
    pytest.skip("No Chromium or Chrome is installed.", allow_module_level=True)

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
QUIET = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-first-run",
)
LONGEST = 240_000  # milliseconds until a notebook has run, on a busy machine
RUN_ALL = """async longest => {
    const tooLong = new Promise(done => setTimeout(() => done('it takes too long'), longest));
    await Promise.race([jupyterapp.shell.currentWidget.sessionContext.ready, tooLong]);
    return Promise.race([jupyterapp.commands.execute('notebook:run-all-cells'), tooLong]);
}"""  # JupyterLab's own command tells when the last cell has ended, and whether each ended well
BAD = '[data-mime-type="application/vnd.jupyter.error"], [data-mime-type="application/vnd.jupyter.stderr"]'


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """A JupyterLab over a copy of the course."""
    folder = tmp_path_factory.mktemp("lab")
    for part in ("notebooks", "hdr_helpers", "data"):
        shutil.copytree(ROOT / part, folder / part, ignore=shutil.ignore_patterns("results", "__pycache__"))
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", "--ServerApp.port_retries=0"]
    options = [f"--port={port}", "--ip=127.0.0.1", "--IdentityProvider.token=", f"--ServerApp.root_dir={folder}"]
    options += ["--LabApp.news_url=", "--LabApp.check_for_updates_class=jupyterlab.NeverCheckForUpdate"]
    options += ["--LabApp.expose_app_in_browser=True"]
    environment = os.environ | {
        "PYTHONPATH": str(folder),
        "HDR_CHECKS_MUST_PASS": "1",
        "HDR_RESULTS": str(folder / "results"),
    }
    environment |= {"JUPYTER_CONFIG_DIR": str(folder / "config"), "JUPYTERLAB_SETTINGS_DIR": str(folder / "settings")}
    with open(folder / "log", "w") as log:
        server = subprocess.Popen(command + options, env=environment, cwd=folder, stdout=log, stderr=log)
    try:
        for _ in range(240):
            try:
                urllib.request.urlopen(f"http://127.0.0.1:{port}/api", timeout=2)
                break
            except OSError:
                time.sleep(0.5)
        else:
            pytest.fail((folder / "log").read_text()[-2000:])
        yield f"http://127.0.0.1:{port}/lab/tree/notebooks"
    finally:
        server.terminate()
        server.wait(20)


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as engine:
        opened = engine.chromium.launch(executable_path=BROWSER, args=list(QUIET))
        yield opened
        opened.close()


def is_the_pages(message):
    """Is this an error of the page, and not that a browser without a network could not fetch something?"""
    return message.type == "error" and not message.text.startswith("Failed to load resource")


def pictures(cell):
    """The addresses of the pictures in a cell's output."""
    return cell.locator("img").evaluate_all("images => images.map(image => image.src)")


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_in_jupyterlab_and_its_explorer_answers_the_keyboard(notebook, address, browser):
    page = browser.new_page(viewport={"width": 1250, "height": 1000})
    errors = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda message: errors.append(message.text) if is_the_pages(message) else None)
    page.goto(f"{address}/{notebook.name}?reset")
    page.wait_for_selector(".jp-Notebook .jp-Cell", timeout=90_000)
    page.wait_for_selector('.jp-NotebookPanel-toolbar [data-status="idle"]', timeout=90_000)
    errors.clear()  # what a browser without a network says at the start is not the notebook's
    ran = page.evaluate(RUN_ALL, LONGEST)
    assert page.locator(BAD).count() == 0, page.locator(BAD).first.inner_text()
    assert ran is True

    slider = page.locator(".widget-slider .noUi-handle").first
    for _ in range(40):  # JupyterLab draws the cells that are near
        if slider.count():
            break
        page.locator(".jp-WindowedPanel-outer").evaluate("panel => { panel.scrollTop += 700 }")
        page.wait_for_timeout(250)
    slider.scroll_into_view_if_needed()
    cell = page.locator(".jp-CodeCell", has=page.locator(".widget-slider")).first
    page.wait_for_timeout(1000)
    before = pictures(cell)
    assert before
    slider.focus()
    for key in ("ArrowLeft", "ArrowLeft", "ArrowRight", "ArrowLeft"):
        page.keyboard.press(key)
        page.wait_for_timeout(150)
    for _ in range(120):
        if pictures(cell) != before:
            break
        page.wait_for_timeout(250)
    after = pictures(cell)
    assert after != before, "the picture did not change"
    assert len(after) == len(before), "pictures pile up"
    assert page.locator(BAD).count() == 0
    assert errors == []
    page.close()
