"""Answers to TODO 3.6, the plot."""

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from mistakes.corpus import answer, right, slip, wrong

answer(
    "3.6",
    """
    def plot_curves(crf):
        fig = Figure()
        ax = fig.subplots()
        for g, colour in zip(crf, ["red", "green", "blue"]):
            ax.semilogy(np.arange(256), np.exp(g), color=colour, label=colour)
        ax.set_xlabel("pixel value")
        ax.set_ylabel("exposure")
        ax.legend()
        return fig
    """,
)
slip("3.6", "Red and blue", '["red", "green", "blue"]', '["blue", "green", "red"]')
slip("3.6", "same colour", "color=colour", 'color="black"')
slip("3.6", "linear", "semilogy", "plot")
slip("3.6", "shows g", "np.exp(g)", "g")
slip("3.6", "log exposure", '"exposure"', '"log exposure"')
slip("3.6", "no label", '    ax.set_xlabel("pixel value")\n', "")
slip("3.6", "legend", "    ax.legend()\n", "")
slip("3.6", "axes are swapped", "ax.semilogy(np.arange(256), np.exp(g)", "ax.loglog(np.exp(g), np.arange(256)")
slip("3.6", "Axes", "return fig", "return ax")
slip("3.6", "tuple", "return fig", "return fig, ax")
slip("3.6", "None", "return fig", "fig.show")
slip("3.6", "1 lines", "zip(crf,", "zip(crf[:1],")


@wrong("3.6", says="None")
def shown_and_nothing_returned(crf):
    for g in crf:
        plt.plot(np.exp(g))
    plt.show()


@right("3.6")
def by_pyplot(crf):
    fig, axes = plt.subplots(1, 3)
    for ax, g, colour in zip(axes, crf, "rgb", strict=True):
        ax.plot(np.exp(g), c=colour)
        ax.set(yscale="log", xlabel="Z", ylabel="exposure", title=colour)
    return fig


@right("3.6")
def all_at_once(crf):
    fig = Figure()
    ax = fig.add_subplot()
    lines = ax.plot(np.exp(crf.T))
    for line, colour in zip(lines, ("#d00000", "tab:green", (0, 0, 1)), strict=True):
        line.set_color(colour)
    ax.set_yscale("log")
    fig.legend(lines, ["R", "G", "B"])
    ax.set(xlabel="measured value", ylabel="exp(g)")
    return fig
