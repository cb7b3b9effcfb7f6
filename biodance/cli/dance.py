"""Commands of the dance: criteria."""

import sys

from biodance.cli.app import DONE, Json, app, print_json, progress


@app.command
def criteria(*, ranges: str = "frontal", json: Json = False) -> int:
    """Compare all excitation criteria on the planar chain: each designs a motion of 2 s, each judges all of them.

    Parameters
    ----------
    ranges
        Assumed joint ranges of the chain: frontal, equal or wide.
    """
    from biodance.body.planar import planar_chain
    from biodance.dance.planar import compared

    body = planar_chain(ranges=ranges)
    with progress() as tell:
        tell("designing one motion with every criterion")
        found = compared(body)
    if json:
        score = {name: dict(zip(found.names, row, strict=True)) for name, row in zip(found.names, found.score.tolist(), strict=True)}
        print_json(
            {"criteria": list(found.names), "score": score, "sd_before": found.sd_before.tolist(), "sd_after": found.sd_after.tolist()}
        )
    else:
        sys.stdout.write(f"{found.table()}\nA row is a design, a column a judge; * is the best of the column; smaller is better.\n")
    return DONE
