"""Reads a configuration as dstack does: dstack_task.py FILE. Runs in the environment that has dstack."""

import sys

import yaml
from dstack._internal.core.models.configurations import parse_run_configuration

with open(sys.argv[1], encoding="utf-8") as file:
    task = parse_run_configuration(yaml.safe_load(file))
notice = int(task.commands[-1].split("--notice ")[1].split()[0])
if task.stop_duration <= notice:
    sys.exit(f"stop_duration {task.stop_duration} s is not longer than --notice {notice}")
