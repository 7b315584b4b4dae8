"""Viewers' commands as requests to a session (hello and shutdown are the process's own)."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from daq_app.acquisition.course.plan_order import plan_of
from daq_app.acquisition.course.preflight import check_name
from daq_app.acquisition.messages.items import RequestRefused
from daq_app.acquisition.messages.published import Command, Reply
from daq_app.acquisition.session.session import Session
from daq_app.acquisition.viewers.desk import Answer
from daq_app.runfile import TestPlan

_T = TypeVar("_T")


def answer(session: Session, command: Command) -> Answer:
    """Answer a viewer's command (not hello and shutdown, which the process answers)."""
    match command.name:
        case "preview":
            return Reply(ok=True, text=session.preview())
        case "arm":
            check_name(str(command.arguments.get("test", session.analyst.voice.plan.test)))
            plan = plan_of(command.arguments, session.analyst.voice.plan)
            overrule = bool(command.arguments.get("overrule", 0))
            return _reply_of(session.arm(plan, overrule=overrule), _answered)
        case "plan":
            chosen = plan_of(command.arguments, TestPlan())
            return _reply_of(session.ask("plan", {"plan": chosen}), _answered)
        case "tare" | "check" | "pull" | "abort" | "stop" | "marker" | "note":
            return _reply_of(session.ask(command.name, dict(command.arguments)), _answered)
    raise RequestRefused(
        f"There is no command '{command.name[:40]}'. There are hello, preview, plan, tare, check, "
        "pull, arm, abort, stop, marker, note and shutdown"
    )


def _answered(answer: tuple[str, dict[str, Any]]) -> Reply:
    return Reply(ok=True, text=answer[0], data=answer[1])


def _reply_of(asked: Future[_T], say: Callable[[_T], Reply]) -> Future[Reply]:
    reply: Future[Reply] = Future()

    def pass_on(done: Future[_T]) -> None:
        error = done.exception()
        reply.set_result(say(done.result()) if error is None else Reply(ok=False, text=str(error)))

    asked.add_done_callback(pass_on)
    return reply
