"""Commands about this machine: doctor."""

from biodance.cli.app import DONE, NEEDS_A_PERSON, app, print_json
from biodance.cli.options import JsonOption
from biodance.cli.progress import progress


@app.command(name="doctor")
def doctor_command(*, json: JsonOption = False) -> int:
    """Say what works on this machine, and how to mend what does not."""
    from dataclasses import asdict

    from rich.console import Console

    from biodance.doctor import examine_machine
    from biodance.report.terminal import print_findings

    with progress() as tell:
        findings = examine_machine(tell=tell)
    if json:
        print_json([asdict(finding) for finding in findings])
    else:
        print_findings(findings, Console())
    return DONE if all(finding.works for finding in findings if finding.needed) else NEEDS_A_PERSON
