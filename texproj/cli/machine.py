"""The command that tells what this machine offers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from texproj.cli import talk
from texproj.cli.exits import DONE
from texproj.cli.shared import Json


def doctor(
    *,
    bundle: Annotated[
        Path | None,
        Parameter(help="A project: also write DIR-report.zip, all that a report of a fault needs."),
    ] = None,
    json: Json = False,
) -> int:
    """Tell what this machine offers, what is missing and how to get it.

    Example: texproj doctor
    """
    from texproj.doctor import examine  # noqa: PLC0415

    findings = examine()
    if bundle is not None:
        return _bundle(bundle, findings, json)
    if json:
        talk.say_json({"findings": [vars(finding) for finding in findings]})
        return DONE
    for finding in findings:
        mark = "ok     " if finding.good else "MISSING"
        talk.say(f"{mark} {finding.name:12} {finding.detail}")
        if finding.remedy:
            talk.say(f"        {'':12} -> {finding.remedy}")
    return DONE


def _bundle(project: Path, findings: Sequence[Any], json: bool) -> int:
    from texproj.bundle import write_bundle  # noqa: PLC0415

    target = Path(f"{project.resolve().name}-report.zip")
    names = write_bundle(project, findings, target)
    if json:
        talk.say_json({"file": str(target), "holds": names})
    else:
        talk.say(f"wrote {target}: {len(names)} files, no photo, no mask, no mesh; look into it")
    return DONE
