"""Where frames are analysed: on the device that was asked for, or a word why not."""

import threading
from concurrent.futures import thread as futures_thread

import moderngl
import numpy as np
import pytest
from compute_shaders import own_context
from hard_pictures import frame_of

from evenlight.data_schema.contrast_model import DEFAULT_MODEL, ContrastModel, SensitivityModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.method.choices import AnalysisEffort, Device
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.loss_curves import analyze_frames, brightness_factors, make_frame_analysis
from evenlight.method.gpu.context import OwnContext, compute_context, is_software, require_compute
from evenlight.method.gpu.frame_loss import GpuFrameAnalysis, GpuLoss

LAB = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0)
FACTORS = brightness_factors(0.2, 7)
FRAME = frame_of(np.random.default_rng(0).random((16, 24)))


def made(device, model=DEFAULT_MODEL):
    """The analysis on a device."""
    return make_frame_analysis((16, 24), LAB, model, FACTORS, device)


def broken(*_, **__):
    """What moderngl does where there is no driver."""
    raise Exception("cannot open shared object file")


@pytest.fixture
def without_graphics(monkeypatch):
    """A machine without OpenGL."""
    monkeypatch.setattr(moderngl, "create_context", broken)


def test_the_processor_is_the_default_and_needs_no_graphics(without_graphics):
    chosen = make_frame_analysis((16, 24), LAB, ContrastModel(), FACTORS)
    assert (type(chosen.analysis), chosen.device) == (FrameAnalysis, Device.CPU)


def test_both_devices_give_the_same_curve():
    own_context()
    on_gpu = made(Device.GPU)
    assert (type(on_gpu.analysis), on_gpu.device) == (GpuFrameAnalysis, Device.GPU)
    assert on_gpu.reason == own_context().renderer != ""
    np.testing.assert_allclose(
        on_gpu.analysis.of(FRAME).loss, made(Device.CPU).analysis.of(FRAME).loss, atol=1e-3
    )


def test_without_a_driver_the_user_is_told_what_to_do(without_graphics):
    words = r"no graphics processor with compute shaders, OpenGL 4\.3 \(cannot open .*device cpu"
    with pytest.raises(InputError, match=words) as told:
        made(Device.GPU)
    assert "\n" not in str(told.value)
    automatic = made(Device.AUTO)
    assert (type(automatic.analysis), automatic.device) == (FrameAnalysis, Device.CPU)
    assert automatic.reason == str(told.value)


def test_without_moderngl_the_user_is_told_what_to_do(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "moderngl", None)
    with pytest.raises(InputError, match="the graphics processor needs the package moderngl"):
        compute_context()


def test_a_driver_that_is_too_old_is_named():
    class Old:
        version_code, info = 330, {"GL_RENDERER": "Old Card"}

    with pytest.raises(InputError, match=r"Old Card offers OpenGL 3\.3, and compute shaders need 4\.3; use"):
        require_compute(Old())
    with pytest.raises(InputError, match=r"Old Card offers OpenGL 3\.3"):
        GpuLoss(Old(), (16, 24), LAB)


def test_a_context_without_compute_shaders_is_released_before_the_next_is_tried(monkeypatch):
    class Old:
        version_code, info = 330, {"GL_RENDERER": "Old Card"}

        def release(self):
            released.append(self)

    made, released = [], []

    def create(**_):
        assert released == made
        made.append(Old())
        return made[-1]

    monkeypatch.setattr(moderngl, "create_context", create)
    with pytest.raises(InputError, match=r"Old Card offers OpenGL 3\.3"):
        compute_context()
    assert len(released) == len(made) == 2


@pytest.mark.parametrize("software", [True, False])
def test_automatic_takes_the_graphics_processor_only_where_it_is_one(software, monkeypatch):
    own_context()
    monkeypatch.setattr("evenlight.method.contrast.loss_curves.is_software", lambda _: software)
    chosen = made(Device.AUTO)
    assert chosen.device is (Device.CPU if software else Device.GPU)
    assert ("runs on the processor here" in chosen.reason) is software


@pytest.mark.parametrize(
    ("renderer", "software"),
    [
        ("llvmpipe (LLVM 15.0.6, 256 bits)", True),
        ("zink Vulkan 1.3(llvmpipe (LLVM 15.0.6, 256 bits) (LAVAPIPE))", True),
        ("Software Rasterizer", True),
        ("zink Vulkan 1.3(NVIDIA GeForce RTX 4090 (NVIDIA_PROPRIETARY))", False),
        ("AMD Radeon RX 7900 XTX (radeonsi, navi31, LLVM 17.0.6)", False),
        ("Mesa Intel(R) Arc(tm) A770 Graphics (DG2)", False),
    ],
)
def test_software_is_told_from_hardware_by_its_name(renderer, software):
    assert is_software(renderer) is software


def test_frames_larger_than_the_drivers_buffers_are_refused(monkeypatch):
    own = own_context()
    info = own.run(lambda: own.context.info)
    monkeypatch.setattr(own.context, "_info", info | {"GL_MAX_SHADER_STORAGE_BLOCK_SIZE": 1000})
    with pytest.raises(
        InputError, match=r"need a buffer of .* MiB on the graphics processor, whose driver allows"
    ):
        GpuFrameAnalysis((16, 24), LAB, ContrastModel(), FACTORS, own)


def test_frames_may_come_from_any_thread_and_another_context_stays_current():
    """A scene is drawn in a context of its own, beside the analysis."""
    own = own_context()
    scene = moderngl.create_context(standalone=True, backend="egl")
    drawn = scene.framebuffer(scene.texture((1, 1), 4))
    analysis = GpuFrameAnalysis((16, 24), LAB, ContrastModel(), FACTORS, own)
    expected, found = analysis.of(FRAME).loss, []
    threads = [threading.Thread(target=lambda: found.append(analysis.of(FRAME).loss)) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    drawn.clear(1.0, 0.0, 0.0, 1.0)
    assert drawn.read(components=4) == bytes([255, 0, 0, 255])
    scene.release()
    np.testing.assert_array_equal(found, [expected] * 3)


def test_a_context_that_is_let_go_ends_its_thread():
    own_context()
    before = set(threading.enumerate())
    own = OwnContext()
    (thread,) = set(threading.enumerate()) - before
    with futures_thread._global_shutdown_lock:  # as where an executor is given work as garbage is collected
        del own
    thread.join(timeout=10)
    assert not thread.is_alive()


def test_a_video_is_analysed_where_it_is_asked_to_be():
    own_context()
    frames = [Frame(0.1 * k, 0.1, np.roll(FRAME, k // 2, axis=0)) for k in range(3)]
    on_gpu, on_processor = (
        analyze_frames(
            iter(frames), "clip", LAB, factors=FACTORS, effort=AnalysisEffort(jobs=2, device=device)
        )
        for device in (Device.GPU, Device.CPU)
    )
    np.testing.assert_allclose(on_gpu.loss, on_processor.loss, atol=1e-3)
    np.testing.assert_allclose(on_gpu.mean_luminance, on_processor.mean_luminance, rtol=1e-6)


def test_a_model_that_only_the_processor_computes_goes_there():
    authors = ContrastModel(sensitivity=SensitivityModel.AUTHORS)
    with pytest.raises(InputError, match="got 'authors'"):
        made(Device.GPU, authors)
    assert made(Device.AUTO, authors).device is Device.CPU


def test_a_video_for_a_missing_graphics_processor_is_refused(without_graphics):
    with pytest.raises(InputError, match=r"OpenGL 4\.3"):
        analyze_frames([Frame(0.0, 0.1, FRAME)], "clip", LAB, effort=AnalysisEffort(device=Device.GPU))
