"""Much work, many processes: jobs in workers that can be killed, results kept by what decided them."""

from sim.runner.pool import End, Ended, Pool, cores
from sim.runner.tasks import Stopped, Task, TaskStore, run_tasks

__all__ = ["End", "Ended", "Pool", "Stopped", "Task", "TaskStore", "cores", "run_tasks"]
