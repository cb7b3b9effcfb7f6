"""What a person must look at: the first thing on the page and the last thing on the terminal."""

from biodance.pipeline.results import SessionResult
from biodance.report.wording import without_path


def attention(result: SessionResult) -> list[tuple[str, str]]:
    """Return (where, sentence) of every file refused, step refused, fit that failed, warning, and check outside its limit."""
    found = [(file, without_path(why, file)) for file, why in result.session.refused.items()]
    found += [("Session", step.text) for step in result.steps if step.status != "done"]
    found += [(f"Identification, {what}", f"Not solved. {cause}") for what, cause in result.failures.items()]
    found += [("Body", text.removeprefix("Warning: ")) for text in result.doubts]
    for trial in result.trials:
        name = trial.trial.name
        found += [(f"Trial {name}", text.removeprefix(f"Trial {name}: ")) for text in trial.reasons]
    outside = [check for check in result.all_checks if not check.inside]
    return found + [(f"{check.what}, {check.where}", f"{check.value}, should be {check.limit}. {check.advice}") for check in outside]
