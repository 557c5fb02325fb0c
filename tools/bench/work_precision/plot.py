"""Picture of one problem of ``measure.py``: error against force calls and against seconds."""

from pathlib import Path

FLOOR = 1e-16  # [-] errors of 0 are drawn here


def plot(report: dict, path: Path) -> None:
    """Draw the report of a problem; the efficient frontier is ringed, mixed precision is dashed."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    keys = ["force_calls"] + (["seconds"] if report["cost"] == "seconds" else [])
    figure, axes = plt.subplots(1, len(keys), figsize=(1.5 + 5.5 * len(keys), 6.5), squeeze=False, sharey=True)
    names = list(dict.fromkeys(s["integrator"] for s in report["settings"]))
    ringed = {tuple(entry) for entry in report["frontier"]}
    batch = f"one thread, {report['copies']} copies" if report["copies"] != 1 else "one thread"
    labels = {"force_calls": "force calls", "seconds": f"wall time [s], {batch}"}
    for ax, key in zip(axes[0], keys, strict=True):
        for number, name in enumerate(names):
            for precision, style in (("double", "-"), ("mixed", "--")):
                points = [
                    s for s in report["settings"]
                    if (s["integrator"], s["precision"]) == (name, precision) and s["error"] is not None
                ]  # fmt: skip
                if not points:
                    continue
                x, y = [s[key] for s in points], [max(s["error"], FLOOR) for s in points]
                label = name if precision == "double" else f"{name}, mixed"
                width = 2.2 if name == "exact_drift" else 1.0
                ax.plot(x, y, style, marker=".", color=f"C{number}", linewidth=width, label=label)
        best = [s for s in report["settings"] if (s["integrator"], s["precision"], s["steps"]) in ringed]
        if key == report["cost"]:
            x, y = [s[key] for s in best], [max(s["error"], FLOOR) for s in best]
            ax.plot(x, y, "o", markersize=10, fillstyle="none", color="black", label="efficient frontier")
        if report["noise"]:
            ax.axhline(report["noise"], color="grey", linestyle=":", label="twins of the reference")
        ax.set(xscale="log", yscale="log", xlabel=labels[key])
        ax.grid(alpha=0.3)
    finite = [max(s["error"], FLOOR) for s in report["settings"] if s["error"] is not None]
    axes[0][0].set_ylim(0.3 * min(finite), 3.0 * min(max(finite), 10.0))  # what exploded is out of the picture
    axes[0][0].set_ylabel("error [-]")
    figure.suptitle(f"{report['title']}\n{report['error_is']}", fontsize=9)
    told = report["others_win"] or ["exact_drift is the cheapest at every error reached"]
    figure.text(0.01, 0.01, "\n".join(told), fontsize=7, va="bottom")
    handles, names = axes[0][-1].get_legend_handles_labels()
    figure.legend(handles, names, loc="lower right", ncols=2 if len(keys) == 1 else 3, fontsize=7)
    lines = max(len(told), len(names) // 2)
    figure.tight_layout(rect=(0, 0.03 + 0.02 * lines, 1, 1))
    figure.savefig(path, dpi=90)
    plt.close(figure)
