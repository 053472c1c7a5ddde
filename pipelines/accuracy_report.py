"""Tables of the accuracy benchmark."""

from __future__ import annotations

from typing import Any

METHODS = ("filtered", "paper", "weak", "refined")
LABELS = ("k1", "k2", "k3", "k4", "k5", "k6", "k7", "m_p")


def markdown(found: dict[str, Any]) -> str:
    """All tables, asked beside measured."""
    lines = [
        f"# Accuracy, {found['draws']} draws",
        "",
        *_noise(found["noise"]),
        "",
        *_side_by_side(found["noise"]),
    ]
    lines += ["", *_table4(found["table4"])]
    for title in ("timing", "cost"):
        lines += ["", f"## {title}", "", "| what | asked | measured |", "|---|---|---|"]
        lines += [
            f"| {row['what']} | {_number(row['asked'])} | {_number(row['value'])} |"
            for row in found[title]
        ]
    return "\n".join(lines) + "\n"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"


def _noise(rows: list[dict[str, Any]]) -> list[str]:
    lines = [
        "## Refined against the Cramér-Rao bound",
        "",
        "Asked: RMS ≤ 1.2 (encoder 1.5), bias ≤ 0.3, coverage 92 to 98 % (encoder ≥ 90 %).",
        "",
        "| arm | turns | σ_θ | RMS / bound: "
        + " | ".join(LABELS)
        + " | largest bias / σ | coverage % | fell back |",
        "|" + "---|" * (len(LABELS) + 6),
    ]
    for row in rows:
        ratios = " | ".join(f"{value:.2f}" for value in row["rms_over_bound"]["refined"])
        bias = max(abs(value) for value in row["bias_over_sigma"])
        lines.append(
            f"| {row['arm']} | {row['turns'][0]}, {row['turns'][1]} | {_sigma(row)} | {ratios} | "
            f"{bias:.2f} | {100 * row['coverage']:.1f} | {row['fell_back']} |"
        )
    return lines


def _sigma(row: dict[str, Any]) -> str:
    return "12 bit" if row["encoder"] else f"{row['sigma_theta']:.0e}"


def _side_by_side(rows: list[dict[str, Any]]) -> list[str]:
    lines = [
        "## Side by side: RMS error / bound, pooled over k1 … k7 and m_p",
        "",
        "| arm | σ_θ | " + " | ".join(METHODS) + " | refined smallest |",
        "|" + "---|" * 7,
    ]
    for row in rows:
        pooled = row["pooled_over_bound"]
        first = "yes" if min(pooled, key=pooled.__getitem__) == "refined" else "no"
        lines.append(
            f"| {row['arm']} | {_sigma(row)} | {' | '.join(_number(pooled[m]) for m in METHODS)} "
            f"| {first} |"
        )
    return lines


def _table4(rows: list[dict[str, Any]]) -> list[str]:
    lines = [
        "## Without noise: Table 4, asked a hundredth of the paper's error",
        "",
        "| case | row | asked % | measured % |",
        "|---|---|---|---|",
    ]
    for row in rows:
        asked = row["paper_error_percent"] / 100
        lines.append(f"| {row['case']} | {row['row']} | {asked:.2g} | {row['error_percent']:.2g} |")
    return lines
