"""The service: everything of one machine that outlives a client, a program, the plan and the tick."""

from __future__ import annotations

from controller.machine.model import Machine
from controller.messages import message
from controller.service import jobs
from controller.service.engine import Engine
from controller.service.folders import Folders
from controller.service.job_run import JobRun
from controller.service.owners import Owners
from controller.service.run_recorder import RunRecorder
from controller.service.watch import Watch


class Service(Owners):
    """Everything of a machine, and its end; its folders must be writable."""

    def __init__(self, machine: Machine, kept: Folders, engine: Engine | None = None) -> None:
        """``engine``: None makes one. Raises SessionError, ConfigError, OSError."""
        super().__init__(machine, kept, lambda news: self.run.hear(news), engine)
        recorder = RunRecorder(self, self._save_usage)
        self.run = JobRun(self, recorder, self.interrupted)
        self.watch = Watch(self, self.run)

    def close(self) -> None:
        """Stop on the path, drives off, brakes first; then everything else."""
        self.engine.end_run()
        self.sequencer.wait()
        self.run.recorder.close()
        self.run.end(jobs.INTERRUPTED, message("service_ended"))
        self.writer.shutdown(wait=True)
        self._save_usage(at_once=True)
        self.processes.close()
        self.engine.end()
        self.store.close()
        self._folder.cleanup()
