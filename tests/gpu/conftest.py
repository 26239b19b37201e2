"""The device of the GPU tests, and the check that no test leaves an OpenGL error behind."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from glcaustics.gpu import Device, create_device


@pytest.fixture(scope="session")
def device() -> Iterator[Device]:
    """One device for the session, on the backend that GLC_TEST_BACKEND names (egl when unset)."""
    opened = create_device(os.environ.get("GLC_TEST_BACKEND", "egl"))
    yield opened
    opened.close()


@pytest.fixture(autouse=True)
def no_gl_errors(request: pytest.FixtureRequest) -> Iterator[None]:
    """Fails a test that leaves an OpenGL error; only where the test uses `device`, or none would be opened."""
    if "device" not in request.fixturenames:
        yield
        return
    shared: Device = request.getfixturevalue("device")
    shared.make_current()  # the test before may have opened a device of its own
    shared.check_error("before the test")
    yield
    shared.make_current()
    shared.check_error("after the test")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Everything in this folder is marked `gpu`."""
    for item in items:
        if item.path.is_relative_to(os.path.dirname(__file__)):
            item.add_marker(pytest.mark.gpu)
