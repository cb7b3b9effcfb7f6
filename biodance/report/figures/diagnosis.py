"""Figures of a diagnosis: what is left before and after, where it is left, and what the session could have seen."""

from html import escape

import numpy as np

from biodance.diagnosis.accept import Residuals
from biodance.diagnosis.adequacy import LIMIT
from biodance.diagnosis.diagnosis import Adequacy, Unobservable
from biodance.display import BLACK, BLUE, GREY
from biodance.records import CHANNEL_TITLES, CHANNELS
from biodance.report.figures.curves import Curve, CurveFigure, Strip
from biodance.report.figures.vector import LEFT_SIDE, RIGHT_SIDE, Axis, Frame, Stroke, panel, points, rule, segments


def left_figure(left: tuple[Residuals, Residuals]) -> str:
    """Return measured minus simulated wrench of the first kept trial in six channels: with the body in use, and with
    the findings.
    """
    before, after = (one.left[0] for one in left)
    rate, use = left[0].rate[0], left[0].use[0]
    time = np.arange(len(before)) / rate
    cells = [
        [
            Strip(
                CHANNEL_TITLES[k],
                [
                    Curve(name, np.where(use, value[:, k], np.nan), look)
                    for name, value, look in (("as it is", before, LEFT_SIDE), ("findings accepted", after, RIGHT_SIDE))
                ],
            )
        ]
        for k in (0, 3, 1, 4, 2, 5)
    ]
    return CurveFigure(time, cells, "Measured minus simulated wrench; the numbers are in the table above", use).html()


def adequacy_table(rows: tuple[Adequacy, ...]) -> str:
    """Return what is left per channel and speed of movement, in standard deviations of sessions without fault, as a
    table; darker: further away.
    """
    bands = sorted({row.band_hz for row in rows})
    value = {(row.channel, row.band_hz): row.z for row in rows}
    head = "".join(f'<th scope="col">{"rest" if low == 0 else f"{low:g}–{high:g} Hz"}</th>' for low, high in bands)
    lines = []
    for channel in CHANNELS:
        cells = []
        for one in bands:
            z = value.get((channel, one), float("nan"))
            if not np.isfinite(z):
                cells.append("<td>–</td>")
                continue
            dark = min(max(z, 0.0) / (2 * LIMIT), 1.0)
            grey, white = round(255 - 185 * dark), z > LIMIT
            cells.append(
                f'<td class="n" style="background:rgb({grey},{grey},{grey});color:{"#fff" if grey < 130 else "#000"}">'
                f"{f'<strong>{z:.0f}</strong>' if white else f'{z:.0f}'}</td>".replace(">-0<", ">0<").replace(
                    ">-", ">−"
                )
            )
        lines.append(f'<tr><th scope="row">{escape(channel)}</th>{"".join(cells)}</tr>')
    caption = "Standard deviations of sessions without a fault"
    return (
        f'<table class="narrow heat"><caption>{caption}</caption><thead><tr><th scope="col">channel</th>{head}</tr>'
        f"</thead><tbody>{''.join(lines)}</tbody></table>"
    )


def limits_figure(rows: tuple[Unobservable, ...]) -> str:
    """Return per kind of cause from which size on this session sees it, in typical sizes: the best and the worst of
    its places.
    """
    kinds: dict[str, list[float]] = {}
    for row in rows:
        kinds.setdefault(row.effect, []).append(row.limit / row.typical)
    order = sorted(kinds, key=lambda name: -np.median(kinds[name]))
    words = ((0.01, "1 %"), (0.1, "a tenth"), (1.0, "typical size"), (10.0, "ten times"))
    x = Axis(0.008, 30.0, "smallest size that this session would have seen, in typical sizes", words, log=True)
    y = Axis(-0.6, len(order) - 0.4, "", tuple((float(i), name.replace("_", " ")) for i, name in enumerate(order)))
    marks = [rule(x, 1.0, upright=True, look=Stroke(BLACK, "", 0.9))]
    for i, name in enumerate(order):
        value = np.clip(np.array(kinds[name]), 0.01, 30.0)
        marks.append(segments(x, y, np.array([[value.min(), i], [value.max(), i]]), Stroke(GREY, "", 2.5)))
        marks.append(points(x, y, np.array([np.median(value)]), np.array([float(i)]), Stroke(BLUE)))
    about = "per kind of cause the smallest size that this session would have seen"
    return panel(x, y, marks, about, frame=Frame(480.0, 16.0 * len(order), left=130.0, above=4.0))
