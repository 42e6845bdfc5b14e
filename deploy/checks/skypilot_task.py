"""Reads a task as SkyPilot does: skypilot_task.py FILE. Runs in the environment that has SkyPilot."""

import sys

import sky
import yaml

with open(sys.argv[1], encoding="utf-8") as file:
    task = yaml.safe_load(file)
# What the command line must give.
for table in ("envs", "secrets"):
    task[table] = {name: "given" if value is None else value for name, value in task[table].items()}
sky.Task.from_yaml_config(task)
