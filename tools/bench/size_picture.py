"""Picture of ``speed.py``: time per grain and step against the number of grains, beds alone, beside the peer's."""

from pathlib import Path

COLOURS = {"warpdem": "C0", "peer": "C1"}
STYLES = ("-", "--", ":", "-.")  # by the number of threads


def curves(cases: list[dict]) -> dict[tuple[str, str, int], tuple[list[int], list[float]]]:
    """Numbers of grains and median times [ns] of the beds, ascending, by code ("warpdem" or "peer"), model and threads."""
    found: dict[tuple[str, str, int], list[tuple[int, float]]] = {}
    for case in cases:
        if case["state"].startswith("bed"):
            for code, part in {"warpdem": case, "peer": case.get("peer")}.items():
                if part is not None:
                    curve = found.setdefault((code, case["model"], case["threads"]), [])
                    curve.append((case["grains"], part["ns_per_grain_step"]["median"]))
    return {key: tuple(map(list, zip(*sorted(curve), strict=True))) for key, curve in found.items()}


def draw(report: dict, path: Path) -> None:
    """Draw the beds of a report of ``speed.py`` as PNG."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    found = curves(report["cases"])
    peer = report["versions"]["peer"]
    models = list(dict.fromkeys(model for _, model, _ in found))
    counts = sorted({threads for *_, threads in found})
    figure, axes = plt.subplots(1, len(models), figsize=(1.0 + 5.5 * len(models), 4.5), squeeze=False, sharey=True)
    for ax, model in zip(axes[0], models, strict=True):
        for (code, of, threads), (grains, time) in found.items():
            if of == model:
                name = f"{peer if code == 'peer' else code}, {threads} thread{'s' * (threads > 1)}"
                style = STYLES[counts.index(threads) % len(STYLES)]
                ax.plot(grains, time, style, marker=".", color=COLOURS[code], label=name)
        ax.set(xscale="log", xlabel="grains of a settled bed", title=f"{model} law")
        ax.set_ylim(bottom=0.0)
        ax.grid(alpha=0.3)
        ax.legend(fontsize=8)
    axes[0][0].set_ylabel("ns per grain and step")
    figure.suptitle(f"{report['machine']['processor']}, {report['settings']['precision']} precision", fontsize=9)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)
