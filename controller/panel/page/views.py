"""Which views there are, in the order of the navigation."""

from __future__ import annotations

from controller.panel.page import alarms, drives, jog, programs, run, runs, scene, scope, setup
from controller.panel.page.view import View

VIEWS: tuple[View, ...] = (run, scene, programs, jog, setup, drives, scope, alarms, runs)
