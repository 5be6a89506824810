"""What is pressed on controllers, by OpenXR's actions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from evenlight.hardware.presentation.headset_window import MENU_HELD
from evenlight.hardware.presentation.openxr_runtime import GAZE, NANOSECOND, VARJO_CONTROLLER
from evenlight.hardware.protocols import KeyPress

if TYPE_CHECKING:
    from evenlight.hardware.presentation.openxr_runtime import OpenXRRuntime

HOLD = 1.0  # that a menu button is held to set straight ahead anew [s]
PRESSED, RELEASED = 0.6, 0.4  # of a trigger's or a stick's way: apart, so that a tremor is one press
HANDS = ("left", "right")
VARJO = "varjo/xr-4_controller"
# Trigger, menu (of the left and of the right hand) and stick of each kind of controller, after the registry's
# interaction profiles; a hand whose menu button is the system's takes another.
PROFILES: dict[str, tuple[str, tuple[str, str], str]] = {
    "khr/simple_controller": ("select/click", ("menu/click", "menu/click"), ""),
    "oculus/touch_controller": ("trigger/value", ("menu/click", "b/click"), "thumbstick"),
    "valve/index_controller": ("trigger/value", ("b/click", "b/click"), "thumbstick"),
    "microsoft/motion_controller": ("trigger/value", ("menu/click", "menu/click"), "thumbstick"),
    "htc/vive_controller": ("trigger/value", ("menu/click", "menu/click"), "trackpad"),
    VARJO: ("trigger/value", ("menu/click", ""), "thumbstick"),
}


def direction(stick: tuple[float, float]) -> str:
    """Return where a stick is pushed that left the middle: along the larger of right and up.

    >>> direction((-0.7, 0.3)), direction((0.2, 0.9)), direction((0.0, -0.6))
    ('stick_left', 'stick_up', 'stick_down')
    """
    right, up = stick
    if abs(right) >= abs(up):
        return "stick_right" if right > 0 else "stick_left"
    return "stick_up" if up > 0 else "stick_down"


class Edges:
    """Presses, told from how far a button or a stick is pushed.

    >>> edges = Edges()
    >>> [edges.pressed(far) for far in (0.5, 0.7, 0.5, 0.7, 0.3, 0.7)]  # back to 0.5 is no release
    [False, True, False, False, False, True]
    """

    def __init__(self) -> None:
        self.down = False

    def pressed(self, far: float) -> bool:
        """Take how far it is pushed now, from 0 to 1, and return whether that began a press."""
        before, self.down = self.down, far > (RELEASED if self.down else PRESSED)
        return self.down and not before


class MenuButton:
    """A button that says one thing when it is let go, and another when it was held.

    >>> button = MenuButton()
    >>> pushed = {0.0: 1.0, 0.5: 0.0, 1.0: 1.0, 2.0: 1.0, 2.5: 0.0}
    >>> [button.said(far, time) for time, far in pushed.items()]
    ['', 'menu', '', 'menu_held', '']
    """

    def __init__(self) -> None:
        self._since = math.inf  # when it went down, unless that is said already [s]
        self._edges = Edges()

    def said(self, far: float, now: float) -> str:
        """Take how far it is pushed at a time [s], and return the name of a press that is over, if any."""
        if self._edges.pressed(far):
            self._since = now
        if self._since == math.inf or (self._edges.down and now - self._since < HOLD):
            return ""
        held, self._since = now - self._since >= HOLD, math.inf
        return MENU_HELD if held else "menu"


class Controllers:
    """The controllers of a runtime's session."""

    def __init__(self, runtime: OpenXRRuntime, session: Any) -> None:
        xr, instance = runtime.xr, runtime.instance
        self._xr, self._instance, self._session = xr, instance, session
        self._set = xr.create_action_set(
            instance, xr.ActionSetCreateInfo("evenlight", localized_action_set_name="Evenlight")
        )
        kinds = xr.ActionType
        self._actions = (
            self._action("trigger", "Answer", kinds.FLOAT_INPUT),
            self._action("menu", "Pause", kinds.FLOAT_INPUT),
            self._action("stick", "Choose and move", kinds.VECTOR2F_INPUT),
        )
        self._edges, self._menu = (Edges(), Edges()), MenuButton()  # of trigger and stick
        self._pressed: list[KeyPress] = []
        self._pushed = (0.0, 0.0)
        for profile, (trigger, menus, stick) in PROFILES.items():
            if profile != VARJO or runtime.offers(VARJO_CONTROLLER):
                bindings = [
                    (action, f"/user/hand/{hand}/input/{part}")
                    for hand, menu in zip(HANDS, menus, strict=True)
                    for action, part in zip(self._actions, (trigger, menu, stick), strict=True)
                    if part
                ]
                self._bind(profile, bindings)
        self.gaze: Any = None  # the space that is where the eyes look
        if runtime.offers(GAZE):
            look = self._action("gaze", "Where the eyes look", kinds.POSE_INPUT)
            self._bind("ext/eye_gaze_interaction", [(look, "/user/eyes_ext/input/gaze_ext/pose")])
            self.gaze = xr.create_action_space(session, xr.ActionSpaceCreateInfo(action=look))
        xr.attach_session_action_sets(session, xr.SessionActionSetsAttachInfo(action_sets=[self._set]))

    def sync(self, now: float) -> None:
        """Ask what is pressed at a time on the runtime's clock [s]; without focus nothing is."""
        xr = self._xr
        try:
            xr.sync_actions(
                self._session, xr.ActionsSyncInfo(active_action_sets=[xr.ActiveActionSet(self._set, 0)])
            )
        except xr.exception.SessionNotFocused:
            self._pushed, self._menu = (0.0, 0.0), MenuButton()
            return
        asked = [xr.ActionStateGetInfo(action) for action in self._actions]
        trigger, menu = (xr.get_action_state_float(self._session, info) for info in asked[:2])
        self._note(0, "trigger", trigger.current_state if trigger.is_active else 0.0, trigger)
        if not menu.is_active:
            self._menu = MenuButton()
        elif said := self._menu.said(menu.current_state, now):
            self._pressed.append(KeyPress(said, menu.last_change_time * NANOSECOND))
        stick = xr.get_action_state_vector2f(self._session, asked[2])
        self._pushed = (stick.current_state.x, stick.current_state.y) if stick.is_active else (0.0, 0.0)
        self._note(1, direction(self._pushed), max(map(abs, self._pushed)), stick)

    def presses(self) -> list[KeyPress]:
        """Return what was pressed since the last call, in order."""
        pressed, self._pressed = self._pressed, []
        return sorted(pressed, key=lambda press: press.time)

    def stick(self) -> tuple[float, float]:
        """Return how far a stick is pushed: right and up, each from -1 to 1."""
        return self._pushed

    def names(self) -> Sequence[str]:
        """Return what the runtime calls the controllers of both hands; "none" where there is none."""
        xr, said = self._xr, list[str]()
        for hand in HANDS:
            path = xr.string_to_path(self._instance, f"/user/hand/{hand}")
            found = xr.get_current_interaction_profile(self._session, path).interaction_profile
            name = xr.path_to_string(self._instance, found) if found else ""
            said.append(name.rpartition("interaction_profiles/")[2] or "none")
        return said

    def _action(self, name: str, words: str, kind: Any) -> Any:
        return self._xr.create_action(
            self._set,
            self._xr.ActionCreateInfo(action_name=name, action_type=kind, localized_action_name=words),
        )

    def _bind(self, profile: str, bindings: Sequence[tuple[Any, str]]) -> None:
        """Say which parts of a kind of controller act; runtimes that do not know it skip it."""
        xr, instance = self._xr, self._instance
        suggested = xr.InteractionProfileSuggestedBinding(
            interaction_profile=xr.string_to_path(instance, f"/interaction_profiles/{profile}"),
            suggested_bindings=[
                xr.ActionSuggestedBinding(action, xr.string_to_path(instance, path))
                for action, path in bindings
            ],
        )
        with suppress(xr.exception.PathUnsupportedError):
            xr.suggest_interaction_profile_bindings(instance, suggested)

    def _note(self, edge: int, name: str, far: float, state: Any) -> None:
        if self._edges[edge].pressed(far):
            self._pressed.append(KeyPress(name, state.last_change_time * NANOSECOND))
