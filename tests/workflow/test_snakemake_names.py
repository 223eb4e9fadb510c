"""Names of Snakemake in our sources: its documentation has each of them, so that a release may not take them away."""

import re

from support.projects.workflow_project import ROOT

RULES, HANDLERS, CLI = "snakefiles/rules.rst", "snakefiles/rules.rst, onstart", "executing/cli.rst"
PLUGIN = "the README of snakemake-interface-executor-plugins"
#: The README shows remote executors alone; these are abstract members and the base class of Snakemake's local one.
INTERFACE = "the classes of snakemake-interface-executor-plugins"
LOGGER = "the README of snakemake-interface-logger-plugins"
#: Names, as our sources write them, and the page of the documentation of Snakemake that has them.
DOCUMENTED = {
    "workflow.cores": RULES,
    "rules.input": RULES,
    "rules.output": RULES,
    "snakemake.input": RULES,
    "snakemake.output": RULES,
    "snakemake.params": RULES,
    "snakemake.log": RULES,
    "snakemake.threads": RULES,
    "snakemake.utils import min_version": "snakefiles/writing_snakefiles.rst",
    "snakemake_interface_common.exceptions import WorkflowError": PLUGIN,
    "snakemake_interface_executor_plugins.executors.base import SubmittedJobInfo": PLUGIN,
    "snakemake_interface_executor_plugins.executors.real import RealExecutor": INTERFACE,
    "snakemake_interface_executor_plugins.registry import ExecutorPluginRegistry": INTERFACE,
    "snakemake_interface_executor_plugins.settings import CommonSettings, ExecMode, ExecutorSettingsBase": PLUGIN,
    "snakemake_interface_executor_plugins.executors.remote import RemoteExecutor": PLUGIN,
    "snakemake_interface_executor_plugins.settings import CommonSettings, ExecutorSettingsBase": PLUGIN,
    "self.workflow": PLUGIN,
    "self.tmpdir": PLUGIN,
    "workflow.executor_settings": PLUGIN,
    "job.is_group": PLUGIN,
    "job.name": PLUGIN,
    "job.jobid": INTERFACE,
    "workflow.deployment_settings": INTERFACE,
    "snakemake_interface_logger_plugins.base import LogHandlerBase": LOGGER,
    "snakemake_interface_logger_plugins.common import LogEvent": LOGGER,
    # Of a record: fields of the events, and settings of the logger.
    **{f"record.{name}": LOGGER for name in ("event", "done", "total", "jobid", "job_id", "rule_name", "wildcards")},
    **{f"record.{name}": LOGGER for name in ("input", "output", "log")},
    **{f"asked.{name}": LOGGER for name in ("dryrun", "verbose", "debug_dag", "nocolor")},
    "self.common_settings": LOGGER,
    # Of a job, as of the object of a script, and in the properties that a jobscript gets.
    "job.input": RULES,
    "job.output": RULES,
    "job.params": RULES,
    "job.log": RULES,
    "job.threads": RULES,
}
#: Sources whose ``job`` and ``self`` are Snakemake's.
OF_JOBS = (
    "src/snakemake_executor_plugin_nearharmonic/__init__.py",
    "src/snakemake_executor_plugin_nearharmonic_forkserver/__init__.py",
    "src/nearharmonic_paper/tasks/job.py",
)


#: A source whose ``asked`` are Snakemake's settings; the fields of its records are asked for by name.
OF_RECORDS = "src/snakemake_logger_plugin_nearharmonic/__init__.py"
#: A field of a record, or of the record of the start of its job.
FIELD = re.compile(r'getattr\((?:record|started), ["\']([a-z_]+)["\']')


def names_in(text, *objects):
    """Attributes of Snakemake's objects, and imports from Snakemake, in a source."""
    code = re.sub(r'(?s:""".*?""")|#.*$', "", text, flags=re.MULTILINE)
    code = re.sub(r"\brules\.\w+(?!\.)", "", re.sub(r"\brules\.\w+\.|getattr\(rules, [\w.]+\)\.", "rules..", code))
    yield from re.findall(r"^ *from (snakemake(?!_executor)\w*(?:\.\w+)* import .+)$", code, re.MULTILINE)
    yield from (f"{one}.{name}" for one, name in re.findall(rf"(?<![./])\b({'|'.join(objects)})\.+(\w+)", code))
    yield from (f"workflow.{name}" for name in re.findall(r"\.workflow\.(\w+)", code))


def test_every_name_of_snakemake_is_documented():
    found = set()
    for path in (ROOT / "Snakefile", *ROOT.glob("workflow/**/*.smk")):
        found |= {*names_in(path.read_text(encoding="utf-8"), "workflow", "rules")}
    for path in (*ROOT.glob("src/**/*.py"), *ROOT.glob("workflow/**/*.py")):
        place, text = str(path.relative_to(ROOT)), path.read_text(encoding="utf-8")
        own = ("job", "self") if place in OF_JOBS else ("asked", "self") if place == OF_RECORDS else ()
        names = {*names_in(text, "snakemake", *own)}
        names |= {f"record.{name}" for name in FIELD.findall(text)} if place == OF_RECORDS else set()
        found |= {name for name in names if not name.startswith("self.") or name in DOCUMENTED}
    assert found == DOCUMENTED.keys()
