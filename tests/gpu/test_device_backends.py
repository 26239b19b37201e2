"""How a device is opened: each backend, the order of "auto", a host's context, and what fails with which words."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys

import moderngl
import pytest

from glcaustics.errors import DeviceError
from glcaustics.gpu import backends, create_device
from glcaustics.gpu.backends import AUTO_ORDER, osmesa_library
from glcaustics.gpu.doctor import probe_backend

PROBE = (
    "import json, sys\nfrom glcaustics.gpu.doctor import probe_backend\nprint(json.dumps(probe_backend(sys.argv[1])))"
)


def probe_apart(backend: str, *prefix: str) -> dict:
    """One backend in a process of its own: two Mesa front ends in one process can disturb each other."""
    command = [*prefix, sys.executable, "-c", PROBE, backend]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def check_works(found: dict) -> None:
    assert found["works"], found
    assert found["info"]["version_code"] >= 330
    assert found["float_blend_measured"] is True


def test_egl_works() -> None:
    check_works(probe_apart("egl"))


@pytest.mark.skipif(osmesa_library() is None, reason="libOSMesa is not installed")
def test_osmesa_works() -> None:
    check_works(probe_apart("osmesa"))


@pytest.mark.skipif(shutil.which("xvfb-run") is None, reason="xvfb is not installed")
def test_a_hidden_window_works() -> None:
    check_works(probe_apart("glfw", "xvfb-run", "-a"))


@pytest.fixture
def broken(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Backends listed in it do not open."""
    names: list[str] = []
    real = backends.open_backend

    def open_backend(name: str) -> backends.Opened:
        if name in names:
            raise DeviceError(f"{name} is broken on purpose", remedy="mend it")
        return real(name)

    monkeypatch.setattr("glcaustics.gpu.open_device.open_backend", open_backend)
    return names


def test_auto_takes_the_first_that_works_and_says_so(broken: list[str]) -> None:
    with create_device("auto") as device:
        assert device.backend == "egl"
        assert device.announcements == ["backend auto took egl"]


@pytest.mark.skipif(osmesa_library() is None, reason="libOSMesa is not installed")
def test_auto_says_why_it_passed_over_the_first() -> None:
    code = (
        "from glcaustics.errors import DeviceError\nfrom glcaustics.gpu import backends, open_device\n"
        "def fail(): raise DeviceError('no egl today')\n"
        "backends._open_egl = fail\nwith open_device.create_device('auto') as d: print(d.backend, d.announcements)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True)
    assert done.stdout.strip() == "osmesa ['egl failed: no egl today', 'backend auto took osmesa']"


def test_when_nothing_works_one_line_says_how_to_mend_it(broken: list[str]) -> None:
    broken += AUTO_ORDER
    with pytest.raises(DeviceError) as caught:
        create_device("auto")
    text = str(caught.value)
    assert "\n" not in text
    assert all(f"{name} failed" in text for name in AUTO_ORDER)
    assert "apt-get install libegl1 libgl1 libgl1-mesa-dri libosmesa6" in text


def test_an_unknown_backend_is_refused() -> None:
    with pytest.raises(DeviceError, match="backend 'vulkan' is unknown; use one of auto, egl, osmesa, glfw"):
        create_device("vulkan")


def test_a_window_without_a_display_fails_with_the_remedy() -> None:
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run(
        [sys.executable, "-c", PROBE, "glfw"], env=environment, capture_output=True, text=True, timeout=120, check=True
    )
    found = json.loads(done.stdout.splitlines()[-1])
    assert not found["works"]
    assert "xvfb" in found["error"] and "\n" not in found["error"]
    assert done.stderr == ""


def test_a_hosts_context_is_wrapped_and_left_alive() -> None:
    settings: dict = {"backend": "egl"}
    host = moderngl.create_context(standalone=True, **settings)
    device = create_device(context=host)
    assert device.backend == "host" and device.ctx is host
    device.close()
    texture = host.texture((2, 2), 4)
    assert host.error == "GL_NO_ERROR"
    texture.release()
    host.release()


def test_devices_can_be_opened_and_closed_again_and_again() -> None:
    for _ in range(20):
        with create_device("egl") as device:
            device.texture((64, 64), "rgba32f").release()
    device.close()  # twice is once


def test_two_devices_of_one_process_do_not_mix() -> None:
    with create_device("egl") as first, create_device("egl") as second:
        for device, value in ((first, 1), (second, 2), (first, 3)):
            with device.guard_state():
                texture = device.texture((1, 1), "r8", data=bytes([value]))
                assert device.read(texture)[0, 0] == value
                device.check_error("mixing")
                texture.release()


def test_the_probe_says_what_fails() -> None:
    found = probe_backend("vulkan")
    assert found == {"works": False, "error": "backend 'vulkan' is unknown; use one of auto, egl, osmesa, glfw"}
