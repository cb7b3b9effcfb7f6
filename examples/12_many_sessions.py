"""Go through many visits: one row of a table for each, and those that fail say why.

python examples/12_many_sessions.py [FIGURE.png]      without a name the figure goes into the temporary folder
"""

import sys
import tempfile
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

import biodance


def row(folder: Path) -> dict[str, object]:
    """Return what a visit comes to; a visit that is refused gives the reason instead."""
    try:
        result = biodance.examine(biodance.read_session(folder))
        found = biodance.identify(result)
    except biodance.BiodanceError as refused:
        return {"visit": folder.name, "status": "refused", "reason": str(refused).replace(f"{folder.parent}/", "")}
    thigh = found.table().loc["right_thigh"]
    names = ["table (kg)", "identified (kg)", "sd (kg)"]
    return {
        "visit": folder.name,
        "status": found.status,
        "mass (kg)": result.session.subject.mass,
        **thigh[names].to_dict(),
    }


def main(picture: Path) -> None:
    """Print one row for each of two visits and one broken folder; draw the thighs."""
    with tempfile.TemporaryDirectory() as scratch:
        archive = Path(scratch)
        for seed, (mass, stature, sex) in enumerate(((55.0, 1.62, "F"), (82.0, 1.84, "M"))):
            biodance.simulate(biodance.Subject(mass, stature, sex, 30.0), "squat", archive / f"visit_{seed}", seed=seed)
        (archive / "visit_empty").mkdir()
        table = pd.DataFrame([row(folder) for folder in sorted(archive.iterdir())])
    print(table.drop(columns="reason").to_string(index=False, float_format="%.2f"))
    print(*table["reason"].dropna(), sep="\n")
    done = table[table["status"] == "solved"]
    figure = Figure(figsize=(6, 3.5), layout="constrained")
    axes = figure.subplots()
    interval = 1.96 * done["sd (kg)"]
    axes.errorbar(done["mass (kg)"], done["identified (kg)"], yerr=interval, fmt="o", capsize=3, label="identified")
    axes.plot(done["mass (kg)"], done["table (kg)"], "s", label="table")
    axes.set(xlabel="body mass, kg", ylabel="right thigh, kg, with 95 % interval")
    axes.legend(frameon=False)
    figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else f"{tempfile.gettempdir()}/12_many_sessions.png"))
